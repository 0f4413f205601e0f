import msgspec
import numpy as np
import pytest

from gridpeers.plant.equipment import Line, LineConfig
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.network.merging import merge_nodes
from tests.unit.plant.networks import PAPER_ISLANDS, diagonal, opened


def test_closing_again_restores_exactly(network: Network) -> None:
    """The matrix is a function of the switches alone: opened and closed again, it is the same to the bit."""
    before = network.admittance(network.closed0)
    apart = network.admittance(opened(network, *PAPER_ISLANDS))
    after = network.admittance(opened(network, *PAPER_ISLANDS) | set(map(network.switch_name, PAPER_ISLANDS)))

    assert np.array_equal(before.toarray(), after.toarray())
    assert not np.array_equal(before.toarray(), apart.toarray())


def test_matrix_is_symmetric_and_separates_islands(network: Network) -> None:
    """The admittance matrix is symmetric and has no entry between two islands."""
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
    followers = np.setdiff1d(np.arange(len(network.nodes)), merge.representatives)
    Y = network.admittance(network.closed0)

    assert len(followers) > 0
    assert abs(Y[followers]).sum() == abs(Y[:, followers]).sum() == 0.0
    assert np.all(merge.ratio[merge.representatives] == 1.0)
    terminals = [network.index(inverter.bus, phase) for inverter in network.inverters for phase in "ABC"]
    assert np.isin(terminals, merge.representatives).all()


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
    V = solve_power_flow(standard, standard.closed0).V
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

    ideal = solve_power_flow(standard, standard.closed0).V
    nearly = solve_power_flow(other, frozenset(), tolerance=1e-9).V

    assert 1e-6 < np.abs(ideal - nearly).max() < 5e-3


def test_parallel_regulator_and_switch_are_an_error() -> None:
    """Two ties between the same nodes at different ratios are a short circuit, which is told with both nodes."""
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
