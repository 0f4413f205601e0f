"""Grid-forming inverters against closed forms: our own model and REGFM_A1."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.linalg import expm

from gridpeers.plant.dynamics import Circuit, Dynamics
from gridpeers.plant.dynamics.circuit import aligned_sum
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.regfm_a1 import REGFM_A1
from gridpeers.plant.plant_config import Method
from tests.unit.plant.dynamics.circuits import (
    BALANCED,
    GFL_D,
    GFM_A,
    GFM_D,
    S_B,
    V_B,
    Z_B,
    circuit,
    inverter,
    loaded,
    lone,
    move_source,
    on_stiff_bus,
    pair,
)

Series = NDArray[np.float64]


def crossing(y: Series, level: float, h: float) -> float:
    """Time (s) at which y first passes level, the first sample at label 0."""
    k = int(np.argmax(y >= level))
    return float((k - (y[k] - level) / (y[k] - y[k - 1])) * h)


def settled(y: Series, end: float, within: float, h: float) -> float:
    """Time (s) from which y stays within +-within of end."""
    return float((np.flatnonzero(np.abs(y - end) > within)[-1] + 1) * h)


def test_bases() -> None:
    """200 kVA at 277.1363 V has 1.15207 ohm, and the autotest's filter 0.4507 - j5.2672 S."""
    record = on_stiff_bus(GFM_A).inverters.constants(0)

    assert pytest.approx(240.56, rel=1e-4) == S_B / (3.0 * V_B)
    assert pytest.approx(1.15207, rel=1e-4) == Z_B
    assert complex(record["y_f"]) == pytest.approx(0.4507 - 5.2672j, rel=1e-4)


def test_a_lone_gfm_droops() -> None:
    """A step of 0.5 pu ends 0.3 Hz lower, on the way a first-order lag of 10 ms."""
    plant = lone(GFM_D, 0.3)
    plant.inverters.set_points[0, 0] = 0.3
    plant.connect(loaded(0.3))
    plant.run(500)
    plant.connect(loaded(0.8))

    f = plant.run(2500)[:, 0, 0]

    assert [f[5], f[10], f[25]] == pytest.approx([59.796, 59.742, 59.710], abs=0.003)
    assert f[-1] == pytest.approx(59.7000, abs=0.001)
    assert plant.readings()[0, 3] / V_B == pytest.approx(plant.inverters.set_points[0, 1], abs=1e-4)


def test_the_voltage_controller_alone() -> None:
    """Without load the measured voltage follows V_set with poles -6.25 and -93.7 1/s."""
    plant = lone(GFM_D, 0.0)
    plant.inverters.set_points[0, 1] += 0.01

    s1, s2 = 6.25, 93.7
    for k in range(1, 51):
        plant.run(10)
        t = 10 * k * plant.h
        expected = 0.01 * (1.0 - (s2 * np.exp(-s1 * t) - s1 * np.exp(-s2 * t)) / (s2 - s1))
        assert plant.inverters.state_of(0)["v"] - 1.0 == pytest.approx(expected, abs=0.02 * 0.01)


def test_voltage_droop_on_a_stiff_bus() -> None:
    """1 % of V_set is 0.2 pu of var, 63 % of it after 0.548 s."""
    plant = on_stiff_bus(GFM_A)
    plant.inverters.set_points[0, 1] += 0.01

    q = plant.run(3000)[:, 0, 2] / S_B

    assert q[-1] == pytest.approx(0.200, rel=0.02)
    assert crossing(q, 0.2 * (1.0 - np.exp(-1.0)), plant.h) == pytest.approx(0.548, rel=0.02)


def test_power_step_on_a_stiff_bus() -> None:
    """P_set acts at once on the speed; power follows in 25 ms to a half and 75 ms to 90 %, without overshoot."""
    plant = on_stiff_bus(GFM_A)
    plant.inverters.set_points[0, 0] = 0.3

    out = plant.run(1000)[:, 0]
    p = out[:, 1] / S_B

    assert out[0, 0] == pytest.approx(60.180, abs=0.001)
    assert p[-1] == pytest.approx(0.300, abs=1e-4)
    assert crossing(p, 0.15, plant.h) == pytest.approx(0.0245, abs=0.003)
    assert crossing(p, 0.27, plant.h) == pytest.approx(0.075, abs=0.003)
    assert p.max() < 0.3003


def test_the_default_filter_is_critically_damped() -> None:
    """With the default filter the P-f loop has the poles -50 +- j1.5 1/s."""
    plant = on_stiff_bus(GFM_D, h=0.0002)
    plant.inverters.set_points[0, 0] = 0.001

    filtered = []
    for _ in range(300):
        plant.run(5)
        filtered.append(float(plant.inverters.state_of(0)["p"]) / 0.001)
    t = 0.001 * np.arange(1, 301)
    a, b = 50.0, 1.5
    expected = 1.0 - np.exp(-a * t) * (np.cos(b * t) + a / b * np.sin(b * t))

    assert np.abs(np.array(filtered) - expected).max() < 0.02


@pytest.mark.parametrize(
    ("first", "second", "load", "P_set", "p", "x_over"),
    [
        (GFM_A, GFM_A, 1.8, (0.9, 0.5), (1.1, 0.7), 0.0),
        (replace(GFM_A, P_max=1.0), GFM_A, 1.8, (0.9, 0.5), (1.0, 0.8), -0.754),
        (REGFM_A1, replace(REGFM_A1, P_max=2.0), 1.2, (1.1, 0.1), (0.9, 0.3), -1.508),
    ],
    ids=["by their set-points", "the overload limiter hands over", "the same of REGFM_A1"],
)
def test_two_gfm_share_a_load(
    first: GfmDroop, second: GfmDroop, load: float, P_set: tuple[float, float], p: tuple[float, float], x_over: float
) -> None:
    """Equal droops split what set-points leave; a unit at its P_max leaves the rest, and f, to the other."""
    plant = pair(first, second, load)
    plant.inverters.set_points[:, 0] = P_set

    end = plant.run(10000)[-1]
    got = end[:, 1] / S_B

    assert got == pytest.approx(p, abs=1e-3)
    assert end[:, 0] == pytest.approx(60.0 + 0.6 * (P_set[1] - got[1]), abs=1e-5)
    assert plant.inverters.state_of(0)["x_over"] == pytest.approx(x_over, abs=0.004)


@pytest.mark.parametrize(
    ("k_pp", "k_ip", "peak", "at", "quiet"),
    [(3.0, 30.0, (0.666, 0.671), 0.076, 0.63), (0.0, 90.9, (0.703, 0.709), 0.082, 0.38)],
)
def test_the_limiter_on_a_stiff_bus(
    k_pp: float, k_ip: float, peak: tuple[float, float], at: float, quiet: float
) -> None:
    """P_set 0.8 over Pmax 0.5 overshoots as computed and ends at 0.5 with x+ = -1.131 rad/s."""
    plant = on_stiff_bus(replace(GFM_A, P_max=0.5, k_pp=k_pp, k_ip=k_ip))
    plant.inverters.set_points[0, 0] = 0.8

    p = plant.run(3000)[:, 0, 1] / S_B

    assert peak[0] - 0.01 <= p.max() <= peak[1] + 0.01
    assert np.argmax(p) * plant.h == pytest.approx(at, abs=0.004)
    assert settled(p, 0.5, 0.01, plant.h) == pytest.approx(quiet, abs=0.02)
    assert p[-1] == pytest.approx(0.5, abs=1e-4)
    assert plant.inverters.state_of(0)["x_over"] == pytest.approx(-1.131, abs=1e-3)


def test_a_gfm_does_not_absorb() -> None:
    """Pushed below Pmin = 0 a GFM speeds up until it delivers nothing, above its droop frequency."""
    plant = pair(GFM_A, GFM_A, 0.2)
    plant.inverters.set_points[:, 0] = 0.1, 0.9

    end = plant.run(10000)[-1]
    p = end[:, 1] / S_B

    assert p[0] == pytest.approx(0.0, abs=1e-3)
    assert plant.inverters.state_of(0)["x_under"] > 0.1
    assert end[0, 0] > 60.0 + 0.6 * (0.1 - p[0]) + 0.01


DIRECT = replace(REGFM_A1, voltage_control=False)
METHODS = ("first-order", "second-order")
RESISTIVE = {"R_f": 0.05, "P_max": 2.0, "Q_max": 2.0, "Q_min": -2.0}
"""With a resistance, the negative and zero sequence carry real power; without one, only vars."""


def unbalanced(parameters: GfmDroop, method: Method, *, scale: float = 1.0) -> Dynamics:
    """A lone GFM with 0.9, 0.5 and 0.2 pu + 40 % of vars on its phases, at rest."""
    dynamics = Dynamics(unequal_load(scale), (inverter(parameters),), 0.002, method=method)
    dynamics.start(np.zeros(1), np.zeros(1))
    return dynamics


def unequal_load(scale: float) -> Circuit:
    """Admittances of 0.9, 0.5 and 0.2 pu, times `scale`, each with 40 % of vars."""
    return circuit(np.diag([0.9, 0.5, 0.2]) * scale * (1.0 - 0.4j) / Z_B, [[0, 1, 2]])


def positive_sequence(dynamics: Dynamics) -> tuple[complex, float]:
    """Return power and voltage of the positive sequence (pu) at the first terminal."""
    V_1, I_1 = (complex(aligned_sum(it[0])) / 3.0 for it in (dynamics.inverters.V, dynamics.inverters.I))
    return 3.0 * V_1 * I_1.conjugate() / S_B, abs(V_1) / V_B


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("parameters", [REGFM_A1, DIRECT], ids=["VFlag 1", "VFlag 0"])
def test_it_rests_where_it_starts_on_unequal_phases(parameters: GfmDroop, method: Method) -> None:
    """The start is an equilibrium of what the model measures: nothing moves in 1 s."""
    dynamics = unbalanced(parameters, method)
    before = dynamics.readings()[0].copy()

    out = dynamics.run(500)[:, 0]

    assert np.abs(out[:, 0] - 60.0).max() < 1e-9
    assert np.abs(out[:, 1:3] - before[1:3]).max() / S_B < 1e-9
    assert np.abs(out[:, 3] - before[3]).max() / V_B < 1e-9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("parameters", [REGFM_A1, DIRECT], ids=["VFlag 1", "VFlag 0"])
def test_a_given_v_set_is_met_at_the_start(parameters: GfmDroop, method: Method) -> None:
    """Behind a line with unequal loads it starts with the Q at which its own droop gives V_set, and rests."""
    y = np.eye(3) / ((0.02 + 0.04j) * Z_B)
    load = np.diag([0.9, 0.5, 0.2]) * (1.0 - 0.4j) / Z_B
    network = circuit(np.block([[y, -y], [-y, y + load]]), [[3, 4, 5]], source=V_B * BALANCED)
    dynamics = Dynamics(network, (inverter(parameters),), 0.002, method=method)
    dynamics.start(np.array([0.25]), None, np.array([1.01]))
    before = dynamics.readings().copy()

    out = dynamics.run(500)

    assert dynamics.inverters.set_points[0, 1] == pytest.approx(1.01, abs=1e-9)
    assert np.abs(out[:, :, 0] - 60.0).max() < 1e-9
    assert np.abs(out[:, :, 1:3] - before[:, 1:3]).max() / S_B < 1e-9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("parameters", [REGFM_A1, DIRECT], ids=["VFlag 1", "VFlag 0"])
def test_it_droops_by_the_positive_sequence(parameters: GfmDroop, method: Method) -> None:
    """After a load step f follows P of the positive sequence, and V_set - m_q Q is its voltage, or the internal one."""
    dynamics = unbalanced(replace(parameters, **RESISTIVE), method)
    P_set, V_set, _ = dynamics.inverters.set_points[0]
    dynamics.connect(unequal_load(1.5))

    f = dynamics.run(4000)[-1, 0, 0]
    S, v = positive_sequence(dynamics)
    total = complex(np.sum(dynamics.inverters.V[0] * np.conj(dynamics.inverters.I[0]))) / S_B
    E = float(dynamics.inverters.state_of(0)["E"])

    assert min(abs(total.real - S.real), abs(total.imag - S.imag)) > 0.002
    assert f - 60.0 == pytest.approx(0.6 * (P_set - S.real), abs=1e-7)
    assert (v if parameters.voltage_control else E) == pytest.approx(V_set - 0.05 * S.imag, abs=1e-7)


@pytest.mark.parametrize(("V_set", "Q"), [(1.1, 0.44), (0.9, -0.44)])
def test_the_reactive_limiters_hold(V_set: float, Q: float) -> None:
    """A V_set that asks for 2 pu of vars gives Q_max or Q_min at a stiff bus."""
    dynamics = on_stiff_bus(REGFM_A1)
    dynamics.inverters.set_points[0, 1] = V_set

    q = dynamics.run(5000)[-1, 0, 2] / S_B

    assert q == pytest.approx(Q, abs=1e-5)


def test_a_step_follows_the_poles_of_the_linearised_model() -> None:
    """Steps of P_set and V_set of 1e-4 pu behind X_L at a stiff bus: the responses of the linear model, by expm."""
    X, T, m_p, k_iv, m_q = 0.15, 0.01, 0.01 * 2.0 * np.pi * 60.0, 5.86, 0.05
    h, step, n = 0.0005, 1e-4, 400
    models = {  # states (filtered power, what the power is proportional to); what a set-point of 1 does to them
        "P_set": ([[-1.0 / T, 1.0 / (X * T)], [-m_p, 0.0]], [0.0, m_p]),
        "V_set": ([[-1.0 / T, 1.0 / (X * T)], [-k_iv * m_q, 0.0]], [0.0, k_iv]),
        "V_set, VFlag 0": ([[-1.0 / T - m_q / (X * T)]], [1.0 / (X * T)]),
    }
    for name, (A, B) in models.items():
        dynamics = on_stiff_bus(
            DIRECT if "VFlag" in name else replace(REGFM_A1, P_min=-1.0), h=h, method="second-order"
        )
        dynamics.inverters.set_points[0, 0 if name == "P_set" else 1] += step
        state = "p" if name == "P_set" else "q"
        got = []
        for _ in range(n // 20):
            dynamics.run(20)
            got.append(float(dynamics.inverters.state_of(0)[state]) / step)
        size = len(B)
        joined = np.zeros((size + 1, size + 1))
        joined[:size, :size], joined[:size, size] = A, B
        expected = [expm(joined * 20 * h * k)[0, size] for k in range(1, n // 20 + 1)]
        assert np.abs(np.array(got) - expected).max() < 2e-3 * np.abs(expected).max(), name


@pytest.mark.parametrize("method", METHODS)
def test_a_sag_draws_no_more_than_the_largest_current(method: Method) -> None:
    """At 0.3 pu it would give 4.7 pu; each phase gives ImaxF = 2 pu at most."""
    dynamics = on_stiff_bus(REGFM_A1, method=method)
    move_source(dynamics, 0.3 * V_B * BALANCED)

    dynamics.run(5)
    current = np.abs(dynamics.inverters.I[0]) / (S_B / (3.0 * V_B))

    assert current == pytest.approx(np.full(3, 2.0), rel=1e-6)


@pytest.fixture
def units() -> Inverters:
    return Inverters((inverter(GFL_D), inverter(GFM_D), inverter(GFL_D)), connected=(True, True, False))


def test_each_inverter_has_the_records_of_its_model(units: Inverters) -> None:
    """Each inverter has parameters and states of its own model."""
    assert ["P_f" in (units.state_of(i).dtype.names or ()) for i in range(3)] == [True, False, True]
    assert units.y_f.tolist() == [units.constants(i)["y_f"] for i in range(3)]
    assert units.volt_var[0].tolist() == [1.0, np.inf, 1.0]
    assert units.connected.tolist() == [True, True, False]


def test_rest_is_that_of_the_inverter_asked_for(units: Inverters) -> None:
    """An inverter is set to rest by its place among all, and no other is touched."""
    units.J[1] = units.y_f[1] * units.V_b[1] * 1j
    units.rest(1, 0.2 + 0.1j, 1.01)
    units.rest(2, 0.4 + 0.3j, 0.98)

    assert units.theta() == pytest.approx([0.0, np.pi / 2.0, 0.0])
    assert units.state_of(1)[["p", "q", "v"]].item() == (0.2, 0.1, 1.01)
    assert [units.state_of(i)["P_f"] for i in (0, 2)] == [0.0, 0.4]
    assert [units.state_of(i)["V_m"] for i in (0, 2)] == [0.0, 0.98]


def test_the_power_of_the_inverter_asked_for_is_limited(units: Inverters) -> None:
    """A limit in W bounds one GFL's reference in pu."""
    units.limit_power(2, 0.25 * S_B)

    assert [units.constants(i)["P_max"] for i in (0, 2)] == [GFL_D.P_max, 0.25]
