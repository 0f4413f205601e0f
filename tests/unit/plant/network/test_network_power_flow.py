import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray

from gridpeers.plant.equipment import Line, LineConfig, Load, Source, Switch
from gridpeers.plant.equipment.imported_equipment import LinearElement
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.network.merging import DELTA
from tests.unit.plant.networks import diagonal, feeder, three_phase_bus


def two_buses(load: complex) -> Network:
    """A source, a line of 1 + 1j ohm per phase, a constant-power load, and a switch to a third bus."""
    config = LineConfig(
        name="c",
        phases="ABC",
        Z=diagonal(1 + 1j),
        B=diagonal(0.0),
    )
    return Network(
        feeder(
            buses=tuple(three_phase_bus(name) for name in "123"),
            lines=(Line(name="l", from_bus="1", to_bus="2", phases="ABC", config="c", length=1.0),),
            line_configs=(config,),
            switches=(Switch(name="2-3", alias="", from_bus="2", to_bus="3", phases="ABC", closed=True),),
            loads=(Load(bus="3", connection="Y", model="P", S=(load,) * 3),),
            source=Source(bus="1", V_pu=1.02, angle=0.1),
        )
    )


def test_power_flow_satisfies_the_equations(network: Network) -> None:
    """At the solution, currents into every node but the source's sum to zero, and the power balance closes."""
    solved = solve_power_flow(network, network.closed0)
    merge = network.merge(network.closed0)
    parts: sp.csc_array = network.Y_branches + network.Y_capacitors + network.Y_loads
    residual = merge.gather(parts @ solved.V + network.loads().currents(solved.V))
    source = solved.V[network.source_nodes] @ np.conj(residual[network.source_nodes])
    residual[network.source_nodes] = 0.0

    assert np.abs(residual).max() < 1e-4
    assert source == pytest.approx(solved.S_source, rel=1e-9)
    assert solved.S_source == pytest.approx(solved.S_loads + solved.S_losses + solved.S_capacitors, rel=1e-12)


def test_dead_buses_have_no_voltage_and_no_load() -> None:
    """Nodes that the substation does not reach have zero volts and take no power."""
    network = two_buses(100e3 + 50e3j)

    solved = solve_power_flow(network, frozenset())

    np.testing.assert_allclose(np.abs(solved.V), [2448.0] * 6 + [0.0] * 3)
    assert solved.S_loads == 0
    assert abs(solved.S_source) < 1e-3


def test_injection_and_shunt_are_part_of_the_balance() -> None:
    """A current fed in at the load relieves the source by its power; a shunt takes its own."""
    network = two_buses(100e3 + 50e3j)
    at = [network.index("3", phase) for phase in "ABC"]
    shunt = np.zeros(9, dtype=np.complex128)
    shunt[at] = 1e-3 - 2e-3j

    def feed(V: NDArray[np.complex128]) -> NDArray[np.complex128]:
        current = np.zeros(9, dtype=np.complex128)
        current[at] = np.conj((100e3 + 50e3j) / V[at]) + shunt[at] * V[at]
        return current

    solved = solve_power_flow(network, network.closed0, shunt=shunt, injection=feed)

    np.testing.assert_allclose(np.abs(solved.V), 2448.0, rtol=1e-9)
    assert abs(solved.S_source) < 1.0
    assert solved.S_loads == pytest.approx(300e3 + 150e3j)


def test_unbearable_load_is_told() -> None:
    """A load beyond what the line can carry ends in an error that names the bus, not in numbers."""
    network = two_buses(5e6 + 0j)

    with pytest.raises(ArithmeticError, match=r"power flow did not converge: after \d+ iterations bus [23] phase"):
        solve_power_flow(network, network.closed0)


def test_feeder_without_source_has_no_power_flow() -> None:
    """Without a substation there is no slack, and the error says so."""
    with pytest.raises(ValueError, match='feeder "test" has no source'):
        solve_power_flow(Network(feeder(buses=(three_phase_bus("1"),))), frozenset())


@pytest.mark.parametrize("seed", [434, 1017, 2071])
def test_a_section_with_next_to_nothing_to_ground_is_solved_as_far_as_rounding_lets(seed: int) -> None:
    """Behind a delta winding its voltage to ground may change by more than 1e-8 pu for ever; that is no overload."""
    rng = np.random.default_rng(seed)
    g = -1j * 10.0 ** rng.uniform(-11, -7)
    y_transformer, y_line = (complex(*rng.uniform(5, most, 2) * (1, -1)) for most in (50, 5000))
    across = DELTA.T @ DELTA
    line = y_line * np.linalg.inv(np.full((3, 3), 0.3j) + (0.7 + 0.9j) * np.eye(3))
    behind = y_transformer * across + g * np.eye(3)
    matrices = {
        "12": np.block([[y_transformer * across, -y_transformer * across], [-y_transformer * across, behind]]),
        "23": np.block([[line, -line], [-line, line]]),
    }
    network = Network(
        feeder(
            buses=tuple(three_phase_bus(name) for name in "123"),
            elements=tuple(
                LinearElement(
                    name=ends,
                    nodes=tuple((bus, phase) for bus in ends for phase in "ABC"),
                    Y=tuple(tuple(map(complex, row)) for row in matrix),
                )
                for ends, matrix in matrices.items()
            ),
            loads=(Load(bus="3", connection="D", model="P", S=(200e3 + 100e3j, 100e3 + 0j, 50e3 + 30e3j)),),
            source=Source(bus="1", V_pu=1.0, angle=0.3),
        )
    )

    V = solve_power_flow(network, network.closed0).V.reshape(3, 3)

    assert np.abs(np.abs(V @ DELTA.T) / 2400.0 / np.sqrt(3.0) - 1.0).max() < 0.05
