"""The GFM of model REGFM_A1, against closed forms (`inverter-models.md` section 3.8)."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.linalg import expm

from gridpeers.plant.dynamics import Circuit, Dynamics
from gridpeers.plant.dynamics.circuit import aligned_sum
from gridpeers.plant.equipment.inverter_parameters import REGFM_A1, GfmParameters
from gridpeers.plant.plant_config import Method
from tests.unit.plant.dynamics.circuits import BALANCED, S_B, V_B, Z_B, circuit, inverter, move_source, pair

DIRECT = replace(REGFM_A1, voltage_control=False)
METHODS = ("first-order", "second-order")
RESISTIVE = {"R_f": 0.05, "P_max": 2.0, "Q_max": 2.0, "Q_min": -2.0}
"""With a resistance, the negative and zero sequence carry real power; without one, only vars."""


def unbalanced(parameters: GfmParameters, method: Method, *, scale: float = 1.0) -> Dynamics:
    """A lone GFM with 0.9, 0.5 and 0.2 pu + 40 % of vars on its phases, at rest."""
    dynamics = Dynamics(unequal_load(scale), (inverter(parameters),), 0.002, method=method)
    dynamics.start(np.zeros(1), np.zeros(1))
    return dynamics


def unequal_load(scale: float) -> Circuit:
    """Admittances of 0.9, 0.5 and 0.2 pu, times `scale`, each with 40 % of vars."""
    return circuit(np.diag([0.9, 0.5, 0.2]) * scale * (1.0 - 0.4j) / Z_B, [[0, 1, 2]])


def at_stiff_bus(parameters: GfmParameters, method: Method, h: float) -> Dynamics:
    """A GFM at 1 pu, at rest without power."""
    bus = circuit(np.zeros((3, 3), complex), [[0, 1, 2]], source=V_B * BALANCED)
    dynamics = Dynamics(bus, (inverter(parameters),), h, method=method)
    dynamics.start(np.zeros(1), np.zeros(1))
    return dynamics


def positive_sequence(dynamics: Dynamics) -> tuple[complex, float]:
    """Return power and voltage of the positive sequence (pu) at the first terminal."""
    V_1, I_1 = (complex(aligned_sum(it[0])) / 3.0 for it in (dynamics.inverters.V, dynamics.inverters.I))
    return 3.0 * V_1 * I_1.conjugate() / S_B, abs(V_1) / V_B


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("parameters", [REGFM_A1, DIRECT], ids=["VFlag 1", "VFlag 0"])
def test_it_rests_where_it_starts_on_unequal_phases(parameters: GfmParameters, method: Method) -> None:
    """The start is an equilibrium of what the model measures: nothing moves in 1 s."""
    dynamics = unbalanced(parameters, method)
    before = dynamics.readings()[0].copy()

    out = dynamics.run(500)[:, 0]

    assert np.abs(out[:, 0] - 60.0).max() < 1e-9
    assert np.abs(out[:, 1:3] - before[1:3]).max() / S_B < 1e-9
    assert np.abs(out[:, 3] - before[3]).max() / V_B < 1e-9


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("parameters", [REGFM_A1, DIRECT], ids=["VFlag 1", "VFlag 0"])
def test_a_given_v_set_is_met_at_the_start(parameters: GfmParameters, method: Method) -> None:
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
def test_it_droops_by_the_positive_sequence(parameters: GfmParameters, method: Method) -> None:
    """After a load step f follows P of the positive sequence, and V_set - m_q Q is its voltage, or the internal one."""
    dynamics = unbalanced(replace(parameters, **RESISTIVE), method)
    P_set, V_set, _ = dynamics.inverters.set_points[0]
    dynamics.connect(unequal_load(1.5))

    f = dynamics.run(4000)[-1, 0, 0]
    S, v = positive_sequence(dynamics)
    total = complex(np.sum(dynamics.inverters.V[0] * np.conj(dynamics.inverters.I[0]))) / S_B
    E = float(dynamics.inverters.gfm_state["E"][0])

    assert min(abs(total.real - S.real), abs(total.imag - S.imag)) > 0.002
    assert f - 60.0 == pytest.approx(0.6 * (P_set - S.real), abs=1e-7)
    assert (v if parameters.voltage_control else E) == pytest.approx(V_set - 0.05 * S.imag, abs=1e-7)


def test_the_overload_limiter_hands_over() -> None:
    """The first unit stays at P_max = 0.9 pu, the second takes the rest and sets the frequency."""
    dynamics = pair(REGFM_A1, replace(REGFM_A1, P_max=2.0), 1.2)
    dynamics.inverters.set_points[:, 0] = 1.1, 0.1

    end = dynamics.run(10000)[-1]
    p = end[:, 1] / S_B

    assert p[0] == pytest.approx(0.9, abs=1e-4)
    assert end[:, 0] == pytest.approx(60.0 + 0.6 * (0.1 - p[1]), abs=1e-5)


@pytest.mark.parametrize(("V_set", "Q"), [(1.1, 0.44), (0.9, -0.44)])
def test_the_reactive_limiters_hold(V_set: float, Q: float) -> None:
    """A V_set that asks for 2 pu of vars gives Q_max or Q_min at a stiff bus."""
    dynamics = at_stiff_bus(REGFM_A1, "second-order", 0.002)
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
        dynamics = at_stiff_bus(DIRECT if "VFlag" in name else replace(REGFM_A1, P_min=-1.0), "second-order", h)
        dynamics.inverters.set_points[0, 0 if name == "P_set" else 1] += step
        state = "p" if name == "P_set" else "q"
        got = []
        for _ in range(n // 20):
            dynamics.run(20)
            got.append(float(dynamics.inverters.gfm_state[state][0]) / step)
        size = len(B)
        joined = np.zeros((size + 1, size + 1))
        joined[:size, :size], joined[:size, size] = A, B
        expected = [expm(joined * 20 * h * k)[0, size] for k in range(1, n // 20 + 1)]
        assert np.abs(np.array(got) - expected).max() < 2e-3 * np.abs(expected).max(), name


@pytest.mark.parametrize("method", METHODS)
def test_a_sag_draws_no_more_than_the_largest_current(method: Method) -> None:
    """At 0.3 pu it would give 4.7 pu; each phase gives ImaxF = 2 pu at most."""
    dynamics = at_stiff_bus(REGFM_A1, method, 0.002)
    move_source(dynamics, 0.3 * V_B * BALANCED)

    dynamics.run(5)
    current = np.abs(dynamics.inverters.I[0]) / (S_B / (3.0 * V_B))

    assert current == pytest.approx(np.full(3, 2.0), rel=1e-6)
