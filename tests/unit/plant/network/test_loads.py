from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gridpeers.plant.equipment import Bus, Feeder, Load
from gridpeers.plant.network import Network
from gridpeers.plant.network.merging import Merge
from gridpeers.plant.tables import read_feeder

V_NOM = 2400.0
S = 30e3 + 10e3j
A = np.exp(2j * np.pi / 3.0)


def one_bus(*loads: Load) -> Network:
    """A lone three-phase bus with loads."""
    return Network(
        Feeder(
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


@pytest.mark.parametrize(("model", "expected"), [("Z", 0.81), ("I", 0.90), ("P", 1.00)])
@pytest.mark.parametrize("connection", ["Y", "D"])
def test_power_at_nine_tenths_of_the_voltage(model: str, connection: str, expected: float) -> None:
    """At 0.9 pu an impedance takes 0.81, a constant current 0.90, a constant power 1.00 (checklist row 24)."""
    network = one_bus(load(model, connection, S, S, S))
    V = 0.9 * network.nominal

    power = V @ np.conj(drawn(network, V))

    assert power == pytest.approx(3 * S * expected, rel=1e-12)


@pytest.mark.parametrize("connection", ["Y", "D"])
def test_constant_current_turns_with_the_voltage(connection: str) -> None:
    """Turning all voltages by 30 degrees leaves P and Q of a constant-current load as they were (checklist row 24)."""
    network = one_bus(load("I", connection, S, 2 * S, 0.5 * S))
    V = 0.9 * network.nominal

    before, after = (v @ np.conj(drawn(network, v)) for v in (V, V * np.exp(1j * np.pi / 6.0)))

    assert after == pytest.approx(before, rel=1e-12)


@pytest.mark.parametrize("model", ["Z", "I", "P"])
@pytest.mark.parametrize("connection", ["Y", "D"])
def test_nominal_power_at_nominal_voltage(model: str, connection: str) -> None:
    """At nominal voltage every load takes what its table says, phase by phase."""
    network = one_bus(load(model, connection, S, 0j, 0.5 * S))

    power = network.nominal @ np.conj(drawn(network, network.nominal))

    assert power == pytest.approx(1.5 * S, rel=1e-12)


@pytest.mark.parametrize("model", ["Z", "I", "P"])
def test_balanced_delta_equals_wye(model: str) -> None:
    """At balanced voltages a balanced delta load draws the line currents of a wye load of the same power."""
    wye, delta = (one_bus(load(model, connection, S, S, S)) for connection in "YD")
    V = 0.93 * np.exp(0.2j) * wye.nominal

    np.testing.assert_allclose(drawn(delta, V), drawn(wye, V), rtol=1e-12)


@pytest.mark.parametrize("model", ["Z", "I", "P"])
def test_delta_currents_sum_to_zero(model: str) -> None:
    """A delta load has no return through ground, whatever the voltages."""
    network = one_bus(load(model, "D", S, 2 * S, 0j))
    V = network.nominal * np.array([0.9, 1.05, 1.0]) + 100.0

    current = drawn(network, V)

    assert abs(current.sum()) < 1e-12 * abs(current).max()
    assert abs(current).min() > 1.0


def test_delta_branch_currents_are_differences() -> None:
    """Line currents of a delta load are I_AB - I_CA, I_BC - I_AB, I_CA - I_BC (inverter-models 6.2)."""
    network = one_bus(load("P", "D", S, 2 * S, 3 * S))
    V = network.nominal * np.array([0.9, 1.05, 1.0])
    I_ab, I_bc, I_ca = np.conj(np.array([S, 2 * S, 3 * S]) / (V - np.roll(V, -1)))

    np.testing.assert_allclose(drawn(network, V), [I_ab - I_ca, I_bc - I_ab, I_ca - I_bc], rtol=1e-12)


def test_constant_current_of_the_table() -> None:
    """I0 is conj(S) / V_nom, and phi0 are 0, -120, +120 degrees in wye, +30, -90, +150 in delta."""
    wye, delta = (one_bus(load("I", connection, S, S, S)).loads() for connection in "YD")

    np.testing.assert_allclose(wye.law.I0, S.conjugate() / V_NOM)
    np.testing.assert_allclose(delta.law.I0, S.conjugate() / (np.sqrt(3.0) * V_NOM))
    np.testing.assert_allclose(np.degrees(wye.phi0), [0.0, -120.0, 120.0])
    np.testing.assert_allclose(np.degrees(delta.phi0), [30.0, -90.0, 150.0])
    assert not wye.law.S.any()
    assert not delta.law.S.any()


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


def test_dead_loads_draw_nothing() -> None:
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
