"""What loads draw, and the power flows between the network and them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.typing import NDArray

from gridpeers.plant.dynamics.circuit import PlantError
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.power_flow_at_rest import InverterPowerFlow
from gridpeers.plant.equipment import Bus, Line, LineConfig, Load, Source, Switch, Tables
from gridpeers.plant.equipment.imported_equipment import LinearElement
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.network.merging import DELTA, Merge
from gridpeers.plant.tables import read_feeder
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, V_B, Z_B, circuit, inverter
from tests.unit.plant.networks import diagonal, feeder, three_phase_bus

V_NOM = 2400.0
S = 30e3 + 10e3j
A = np.exp(2j * np.pi / 3.0)


def one_bus(*loads: Load) -> Network:
    return Network(
        Tables(
            name="one bus",
            load_set="test",
            buses=(Bus(name="1", phases="ABC", V_nom=V_NOM),),
            lines=(),
            line_configs=(),
            switches=(),
            loads=loads,
            capacitors=(),
            regulators=(),
            transformers=(),
            inverters=(),
            source=None,
        )
    )


def drawn(network: Network, V: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Currents of all loads of a network (A), of any model."""
    return np.asarray(network.loads().currents(V) + network.Y_loads @ V)


def load(model: Any, connection: Any, *powers: complex) -> Load:
    """A load at the lone bus, with powers per phase or pair of phases."""
    return Load(bus="1", connection=connection, model=model, S=(powers[0], powers[1], powers[2]))


@pytest.mark.parametrize(("model", "exponent"), [("Z", 2), ("I", 1), ("P", 0)])
@pytest.mark.parametrize("connection", ["Y", "D"])
def test_power_follows_the_voltage_by_the_exponent_of_the_model(model: str, connection: str, exponent: int) -> None:
    """At 0.9 pu an impedance takes 0.81, a constant current 0.90 of the table's P + jQ, at any angle."""
    network = one_bus(load(model, connection, S, 2 * S, 0j))

    for voltage in (1.0, 0.9, 0.9 * np.exp(1j * np.pi / 6.0)):
        V = voltage * network.nominal
        assert V @ np.conj(drawn(network, V)) == pytest.approx(3 * S * abs(voltage) ** exponent, rel=1e-12)


@pytest.mark.parametrize("model", ["Z", "I", "P"])
def test_balanced_delta_equals_wye(model: str) -> None:
    """At balanced voltages a balanced delta load draws the line currents of a wye load of the same power."""
    wye, delta = (one_bus(load(model, connection, S, S, S)) for connection in "YD")
    V = 0.93 * np.exp(0.2j) * wye.nominal

    np.testing.assert_allclose(drawn(delta, V), drawn(wye, V), rtol=1e-12)


def test_delta_branch_currents_are_differences() -> None:
    """Line currents of a delta load are I_AB - I_CA, I_BC - I_AB, I_CA - I_BC."""
    network = one_bus(load("P", "D", S, 2 * S, 3 * S))
    V = network.nominal * np.array([0.9, 1.05, 1.0])
    I_ab, I_bc, I_ca = np.conj(np.array([S, 2 * S, 3 * S]) / (V - np.roll(V, -1)))

    np.testing.assert_allclose(drawn(network, V), [I_ab - I_ca, I_bc - I_ab, I_ca - I_bc], rtol=1e-12)


def test_nominal_angles_are_those_of_the_nominal_voltages() -> None:
    """phi0 and V_nom of every branch of the feeder are its voltage at nominal phasors."""
    network = Network(read_feeder("microgrid123"))
    loads = network.loads()

    np.testing.assert_allclose(loads.voltages(network.nominal), loads.V_nom * np.exp(1j * loads.phi0), rtol=1e-12)


def test_loads_of_an_imported_feeder_have_the_angles_without_load() -> None:
    """phi0 of a branch is the angle of the voltage across it without load, which transformers of any kind turn."""
    network = Network(read_feeder("ieee34"))
    loads = network.loads()

    np.testing.assert_allclose(loads.phi0, np.angle(loads.voltages(network.nominal)), rtol=1e-12)


def test_de_energised_loads_draw_nothing() -> None:
    """Without voltage a load draws no current, instead of an infinite one."""
    loads = one_bus(load("P", "Y", S, S, S), load("I", "D", S, S, S)).loads()

    assert not loads.currents(np.zeros(3, dtype=np.complex128)).any()


def test_no_loads_draw_nothing() -> None:
    """A network without non-linear loads has an empty LoadBranches that works as any other."""
    loads = one_bus().loads()

    assert len(loads) == 0
    assert loads.currents(np.ones(3, dtype=np.complex128)).tolist() == [0.0, 0.0, 0.0]


def test_merged_loads_are_the_same_loads() -> None:
    """Moved to the representatives, across regulators too, loads draw the same power and the transformed currents."""
    network = Network(read_feeder("microgrid123"))
    n = len(network.nodes)
    random = np.random.default_rng(7)
    representative = np.repeat(np.arange(0, n, 2, dtype=np.int64), 2)[:n]
    merge = Merge(representative, np.where(representative == np.arange(n), 1.0, random.uniform(0.9, 1.1, n)))
    loads = network.loads()
    moved = loads.on(merge)
    V_rep = network.nominal * random.uniform(0.9, 1.1, n) * np.exp(1j * random.uniform(0.0, 0.3, n))
    V = merge.expand(V_rep)

    np.testing.assert_allclose(moved.powers(V_rep), loads.powers(V), rtol=1e-12)
    np.testing.assert_allclose(moved.currents(V_rep), merge.gather(loads.currents(V)), rtol=1e-12, atol=1e-9)
    assert not np.array_equal(loads.a_from, moved.a_from)


def two_buses(load: complex) -> Network:
    """A source, a line of 1 + 1j ohm per phase, a constant-power load, and a switch to a third bus."""
    config = LineConfig(name="c", phases="ABC", Z=diagonal(1 + 1j), B=diagonal(0.0))
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
    """At the solution the currents into every node but the source's sum to zero."""
    V = solve_power_flow(network, network.closed0)
    merge = network.merge(network.closed0)
    parts: sp.csc_array = network.Y_branches + network.Y_capacitors + network.Y_loads
    residual = merge.gather(parts @ V + network.loads().currents(V))
    residual[network.source_nodes] = 0.0

    assert np.abs(residual).max() < 1e-4


def test_de_energised_buses_have_no_voltage() -> None:
    """Nodes that the substation does not reach have zero volts."""
    V = solve_power_flow(two_buses(100e3 + 50e3j), frozenset())

    np.testing.assert_allclose(np.abs(V), [2448.0] * 6 + [0.0] * 3)


def test_a_load_beyond_the_lines_limit_is_an_error() -> None:
    network = two_buses(5e6 + 0j)

    with pytest.raises(ArithmeticError, match=r"power flow has no solution; the network cannot feed .*at bus 3"):
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

    V = solve_power_flow(network, network.closed0).reshape(3, 3)

    assert np.abs(np.abs(V @ DELTA.T) / 2400.0 / np.sqrt(3.0) - 1.0).max() < 0.05


REACTANCE = 1.0
"""Reactance (pu) between the inverter and a stiff bus of 1 pu; it carries 0.5 pu at most without reactive power."""


def exported(P: float) -> complex:
    """Return the voltage (pu) of an inverter that delivers P (pu) over the reactance; phase A."""
    y = 1.0 / (1j * REACTANCE * Z_B)
    Y = np.kron(np.array([[y, -y], [-y, y]]), np.eye(3))
    network = circuit(Y, [[3, 4, 5]], source=V_B * BALANCED)
    flow = InverterPowerFlow(network, Inverters((inverter(GFL_D),), [True]), np.zeros(1, bool))
    V = flow.solve(np.zeros((1, 3), complex), np.array([P]), np.zeros(1), np.zeros(1, bool))[1]
    return complex(V[0, 0] / V_B)


def test_a_slow_fixed_point_is_followed_to_its_end() -> None:
    """At 0.4997 pu of 0.5 each round leaves 0.966 of the error: V sin(delta) is P, and V is cos(delta)."""
    P = 0.4997
    delta = 0.5 * np.arcsin(2.0 * P)

    assert exported(P) == pytest.approx(np.cos(delta) * np.exp(1j * delta), abs=1e-9)


def test_a_power_beyond_what_the_network_carries_is_refused() -> None:
    """0.51 pu of 0.5: the injections never settle."""
    with pytest.raises(PlantError, match="deliver more than the network can carry"):
        exported(0.51)
