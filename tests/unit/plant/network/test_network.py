import numpy as np
import pytest

from gridpeers.plant.network import Network


def test_nodes_are_in_the_order_of_the_tables(network: Network) -> None:
    """Nodes follow buses.csv and then A, B, C; index finds them again."""
    assert network.nodes[:5] == (("1", "A"), ("1", "B"), ("1", "C"), ("2", "B"), ("3", "C"))
    assert [network.index(*node) for node in network.nodes] == list(range(286))


def test_nominal_phasors(network: Network) -> None:
    """Nominal phasors are V_nom at 0, -120, +120 degrees, behind the delta-delta transformer too."""
    a, b, c = (network.nominal[network.index("610", phase)] for phase in "ABC")

    assert abs(a) == pytest.approx(480 / 3**0.5)
    np.testing.assert_allclose(np.degrees(np.angle([a, b, c])), [0.0, -120.0, 120.0], atol=1e-12)


def test_source_is_bus_150_at_nominal_voltage(network: Network) -> None:
    """The substation is bus 150 at 1.0 pu, and its nodes represent themselves."""
    assert [network.nodes[i] for i in network.source_nodes] == [("150", "A"), ("150", "B"), ("150", "C")]
    np.testing.assert_allclose(network.source_voltage, network.nominal[network.source_nodes])
    merge = network.merge(network.closed0)
    assert list(merge.representative[network.source_nodes]) == list(network.source_nodes)


@pytest.mark.parametrize("text", ["67s-67", "67-67s", "sw1_2"])
def test_switch_is_found_by_every_name(network: Network, text: str) -> None:
    """A switch answers to its buses in both orders and to its alias."""
    assert network.switch_name(text) == "67s-67"


def test_unknown_switch_is_told_with_the_nearest(network: Network) -> None:
    """An unknown switch is told with the one that was probably meant."""
    with pytest.raises(ValueError, match=r'switch "13-125": no such switch in .*; did you mean "13-152"'):
        network.switch_name("13-125")
    with pytest.raises(
        ValueError, match=r'switch "zebra": no such switch in .*; the switches are 13-152, 60-160'
    ) as told:
        network.switch_name("zebra")

    assert " sw1_2, sw2_3" in str(told.value), "where there is an alias, it is what people know the switch by"
    assert "67s-67" not in str(told.value)


def test_aliases_are_not_names(network: Network) -> None:
    """A set of closed switches holds names; an alias or a misspelled name in it is an error, not an open switch."""
    with pytest.raises(ValueError, match=r'"sw1_2" is not in Network.switches; pass it through switch_name'):
        network.admittance(frozenset({"sw1_2"}))
