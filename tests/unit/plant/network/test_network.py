"""The nodes of a feeder's network, its islands, its equipment, and the nodes that ideal devices merge."""

from typing import Any

import msgspec
import numpy as np
import pytest

from gridpeers.plant.equipment import Line, LineConfig, Transformer
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.network.merging import merge_nodes
from tests.unit.plant.networks import PAPER_ISLANDS, diagonal, feeder, opened, three_phase_bus, zones


def test_nodes_are_in_the_order_of_the_tables(network: Network) -> None:
    """Nodes follow buses.csv and then A, B, C; index finds them again."""
    assert network.nodes[:5] == (("1", "A"), ("1", "B"), ("1", "C"), ("2", "B"), ("3", "C"))
    assert [network.index(*node) for node in network.nodes] == list(range(286))


@pytest.mark.parametrize("text", ["67s-67", "67-67s", "sw1_2"])
def test_switch_is_found_by_every_name(network: Network, text: str) -> None:
    """A switch answers to its buses in both orders and to its alias."""
    assert network.switch_name(text) == "67s-67"


def test_an_unknown_switch_gets_the_nearest_name(network: Network) -> None:
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


SWITCHES = {
    (): [("rest", "passive", "MG1", "MG2", "MG3")],
    ("13-152",): [("rest",), ("passive", "MG1", "MG2", "MG3")],
    ("13-152", "60-160"): [("rest",), ("passive",), ("MG1", "MG2", "MG3")],
    ("60-160",): [("rest", "passive"), ("MG1", "MG2", "MG3")],
    PAPER_ISLANDS: [("rest",), ("passive", "MG1"), ("MG2",), ("MG3",)],
}
"""Switches that are opened, and the zones of each island then."""


@pytest.mark.parametrize("switches", SWITCHES)
def test_open_switches_part_the_zones(network: Network, switches: tuple[str, ...]) -> None:
    islands = network.islands(opened(network, *switches))

    assert len(islands) == len(SWITCHES[switches])
    assert set(islands) == {zones(network, *names) for names in SWITCHES[switches]}


def test_islands_are_ordered_by_their_first_bus(network: Network) -> None:
    order = [bus.name for bus in network.feeder.buses]
    islands = network.islands(opened(network, *PAPER_ISLANDS, "60-160"))

    firsts = [min(order.index(bus) for bus in island) for island in islands]
    assert firsts == sorted(firsts)
    assert sum(len(island) for island in islands) == len(order)


def test_lines_without_charging_carry_no_current_at_equal_voltages() -> None:
    """A line's series admittance sees only voltage differences; with charging, half its capacitance is at each end."""
    config = LineConfig(name="c", phases="ABC", Z=diagonal(0.3 + 0.9j), B=diagonal(4e-6))
    line = Line(name="l", from_bus="1", to_bus="2", phases="AC", config="c", length=2.0)
    table = feeder(buses=(three_phase_bus("1"), three_phase_bus("2")), lines=(line,), line_configs=(config,))
    V = np.full(6, 2400.0 + 0j)

    bare, charged = (Network(table, line_charging=charging).Y_branches @ V for charging in (False, True))

    np.testing.assert_allclose(bare, 0.0, atol=1e-9)
    np.testing.assert_allclose(charged, 2400.0 * 4e-6j * np.array([1, 0, 1, 1, 0, 1]), atol=1e-9)


@pytest.mark.parametrize("connection", ["D-D", "Yg-Yg"])
def test_transformer_impedance_and_ratio(connection: Any) -> None:
    """Short-circuited at its secondary, a transformer draws 1/z of its rated current; open, it has its ratio."""
    z = 0.0127 + 0.0272j
    transformer = Transformer(name="t", from_bus="1", to_bus="2", connection=connection, S_rated=150e3, z=z)
    network = Network(
        feeder(buses=(three_phase_bus("1", 2400.0), three_phase_bus("2", 240.0)), transformers=(transformer,))
    )
    Y = network.Y_branches.toarray()
    V = network.nominal[:3]

    short_circuit = Y[:3, :3] @ V
    open_secondary = -np.linalg.solve(Y[3:, 3:], Y[3:, :3] @ V)

    np.testing.assert_allclose(short_circuit, V / 2400.0 * 150e3 / (3 * 2400.0) / z, rtol=1e-12)
    np.testing.assert_allclose(open_secondary, V / 10.0, rtol=1e-12)


def test_delta_transformer_passes_no_zero_sequence() -> None:
    """A voltage common to all phases drives no current through a delta winding."""
    transformer = Transformer(name="t", from_bus="1", to_bus="2", connection="D-D", S_rated=150e3, z=0.01 + 0.03j)
    network = Network(feeder(buses=(three_phase_bus("1"), three_phase_bus("2")), transformers=(transformer,)))

    current = network.Y_branches @ np.array([1000.0, 1000.0, 1000.0, 0.0, 0.0, 0.0])

    np.testing.assert_allclose(current, 0.0, atol=1e-9)


def test_closing_again_restores_exactly(network: Network) -> None:
    """The matrix is a function of the switches alone: opened and closed again, it is the same to the bit."""
    before = network.admittance(network.closed0)
    apart = network.admittance(opened(network, *PAPER_ISLANDS))
    after = network.admittance(opened(network, *PAPER_ISLANDS) | set(map(network.switch_name, PAPER_ISLANDS)))

    assert np.array_equal(before.toarray(), after.toarray())
    assert not np.array_equal(before.toarray(), apart.toarray())


def test_matrix_is_symmetric_and_separates_islands(network: Network) -> None:
    closed = opened(network, *PAPER_ISLANDS, "60-160")
    Y = network.admittance(closed)
    island_of = {bus: i for i, island in enumerate(network.islands(closed)) for bus in island}
    label = np.array([island_of[bus] for bus, _ in network.nodes])
    entries = Y.tocoo()

    assert abs(Y - Y.T).max() < 1e-9 * abs(Y).max()
    assert np.array_equal(label[entries.row], label[entries.col])


def test_only_representatives_have_entries(network: Network) -> None:
    """Rows and columns of nodes that follow another one are empty; each representative is its own, at ratio 1."""
    merge = network.merge(network.closed0)
    followers = np.setdiff1d(np.arange(len(network.nodes)), np.unique(merge.representative))
    Y = network.admittance(network.closed0)

    assert len(followers) > 0
    assert abs(Y[followers]).sum() == abs(Y[:, followers]).sum() == 0.0
    assert np.all(merge.ratio[np.unique(merge.representative)] == 1.0)
    terminals = [network.index(inverter.bus, phase) for inverter in network.inverters for phase in "ABC"]
    assert np.isin(terminals, np.unique(merge.representative)).all()


def test_merging_keeps_power(standard: Network) -> None:
    """Power at the representatives equals power at all nodes, also across regulators: ideal devices take none."""
    merge = standard.merge(standard.closed0)
    random = np.random.default_rng(3)
    V_rep = standard.nominal * random.uniform(0.9, 1.1, len(standard.nodes))
    current = random.normal(size=len(standard.nodes)) + 1j * random.normal(size=len(standard.nodes))

    at_nodes = merge.expand(V_rep) @ np.conj(current)
    at_representatives = V_rep @ np.conj(merge.gather(current))

    assert at_representatives == pytest.approx(at_nodes, rel=1e-12)
    np.testing.assert_allclose(merge.matrix() @ V_rep, merge.expand(V_rep))


def test_regulators_hold_their_ratio(standard: Network) -> None:
    """Each regulator's output is 1 + 0.00625 tap times its input, with the published taps."""
    V = solve_power_flow(standard, standard.closed0)
    gain = {
        (bus, phase): abs(V[standard.index(bus + "r", phase)] / V[standard.index(bus, phase)])
        for bus, phase in (("150", "A"), ("9", "A"), ("25", "A"), ("25", "C"), ("160", "A"), ("160", "C"))
    }

    assert list(gain.values()) == pytest.approx([1 + 0.00625 * tap for tap in (7, -1, 0, -1, 8, 5)], rel=1e-14)


def test_ideal_switches_are_the_limit_of_small_impedances(standard: Network) -> None:
    """Very short lines in place of the closed switches give the same voltages, only less exactly."""
    table = standard.feeder
    short = LineConfig(name="short", phases="ABC", Z=diagonal(1e-3j), B=diagonal(0.0))
    lines = [
        Line(name=s.name, from_bus=s.from_bus, to_bus=s.to_bus, phases=s.phases, config="short", length=1e-3)
        for s in table.switches
        if s.closed
    ]
    other = Network(
        msgspec.structs.replace(
            table, switches=(), lines=(*table.lines, *lines), line_configs=(*table.line_configs, short)
        )
    )

    ideal = solve_power_flow(standard, standard.closed0)
    nearly = solve_power_flow(other, frozenset())

    assert 1e-6 < np.abs(ideal - nearly).max() < 5e-3


def test_parallel_regulator_and_switch_are_an_error() -> None:
    """Two ties between the same nodes at different ratios are a short circuit, and the error names both nodes."""
    with pytest.raises(ValueError, match=r"a bus and b bus are tied twice, at 1.00000 and at 1.05000"):
        merge_nodes(["a bus", "b bus"], [(0, 1, 1.0), (0, 1, 1.05)], [])


def test_ties_in_a_loop_are_no_error() -> None:
    """Closed switches in a ring tie their nodes more often than needed, which is harmless."""
    merge = merge_nodes(["a", "b", "c"], [(0, 1, 1.0), (1, 2, 1.0), (2, 0, 1.0)], [2])

    assert merge.representative.tolist() == [2, 2, 2]
    assert merge.ratio.tolist() == [1.0, 1.0, 1.0]


def test_ratios_multiply_along_a_chain() -> None:
    """Through two regulators in a row, and against their direction, ratios multiply."""
    merge = merge_nodes(["a", "b", "c"], [(0, 1, 1.05), (1, 2, 1.1)], [1])

    assert merge.representative.tolist() == [1, 1, 1]
    np.testing.assert_allclose(merge.ratio, [1 / 1.05, 1.0, 1.1])
