"""Grid-forming inverter: droop, limiters and voltage controller (`inverter-models.md` section 3).

One controller for three phases, of internal voltage E and angle theta. Per unit of the own rating, speeds in rad/s
relative to nominal.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.compiled import A120, Complex, compiled, heun, magnitude, sat
from gridpeers.plant.plant_config import GfmParameters

_NUMBERS = (
    *("T_p", "T_q", "T_v", "P_max", "P_min", "k_pp", "k_ip", "w_lim", "Q_max"),
    *("Q_min", "k_pq", "k_iq", "V_lim", "k_pv", "k_iv", "E_min", "E_max"),
)  # of `GfmParameters`, as they are

PARAMETERS = np.dtype(
    [
        ("S_b", "f8"),  # VA, three phases
        ("V_b", "f8"),  # V, line-to-neutral
        ("y_f", "c16"),  # S, of one phase
        ("I_limit", "f8"),  # A, of one phase
        ("m_p", "f8"),  # rad/s per pu
        ("m_q", "f8"),  # pu per pu
        ("positive_sequence", "b1"),  # measurements of REGFM_A1, section 3.8
        ("voltage_control", "b1"),
        *((name, "f8") for name in _NUMBERS),
    ],
    align=True,
)

STATE = np.dtype(
    [
        ("p", "f8"),  # filtered real power, pu
        ("q", "f8"),  # filtered reactive power, pu
        ("v", "f8"),  # filtered mean terminal voltage, pu
        ("x_over", "f8"),  # integrator of the Pmax limiter, rad/s, <= 0
        ("x_under", "f8"),  # integrator of the Pmin limiter, rad/s, >= 0
        ("y_over", "f8"),  # integrator of the Qmax limiter, pu V, <= 0
        ("y_under", "f8"),  # integrator of the Qmin limiter, pu V, >= 0
        ("e", "f8"),  # integrator of the voltage controller, pu
        ("theta", "f8"),  # angle of phase A's internal voltage, rad
        ("E", "f8"),  # internal voltage, pu (output)
        ("w", "f8"),  # speed relative to nominal, rad/s (output)
    ],
    align=True,
)


def pack(par: GfmParameters, S_b: float, V_b: float, m_p: float, m_q: float, f_nom: float) -> NDArray[np.void]:
    """Parameters of one unit as the compiled pass wants them.

    `S_b`: VA, three phases; `m_p`, `m_q`: pu frequency, voltage per pu power; `f_nom`: Hz, base of m_p.
    """
    Z_b = V_b**2 / (S_b / 3.0)
    record = np.zeros((), PARAMETERS)
    record["S_b"], record["V_b"] = S_b, V_b
    record["y_f"] = 1.0 / (complex(par.R_f, par.X_f) * Z_b)
    record["m_p"], record["m_q"] = m_p * (2.0 * np.pi * f_nom), m_q
    record["I_limit"] = par.I_max * S_b / (3.0 * V_b)
    record["positive_sequence"], record["voltage_control"] = par.model == "regfm_a1", par.voltage_control
    for name in _NUMBERS:
        record[name] = getattr(par, name)
    return record


def settle(g: np.void, state: np.void, J_A: complex, S: complex, v: float) -> None:
    """Set a state to rest (section 7) by the injection of phase A (A), and the measured power and voltage (pu)."""
    E = J_A / g["y_f"]
    state["p"], state["q"], state["v"] = S.real, S.imag, v
    state["x_over"] = state["x_under"] = state["y_over"] = state["y_under"] = state["w"] = 0.0
    state["e"] = state["E"] = abs(E) / g["V_b"]
    state["theta"] = np.angle(E)


@compiled
def measure_positive_sequence(
    g: Any,
    i: int,
    V: Complex,
    I: Complex,  # noqa: E741  # the paper's symbol
) -> tuple[float, float, float]:
    """Return P, Q and V (pu) of inverter i's positive sequence, from its V (V) and I out of it (A); section 3.8."""
    V_1 = (V[i, 0] + A120 * V[i, 1] + A120.conjugate() * V[i, 2]) / 3.0
    I_1 = (I[i, 0] + A120 * I[i, 1] + A120.conjugate() * I[i, 2]) / 3.0
    S = 3.0 * V_1 * I_1.conjugate() / g.S_b
    return S.real, S.imag, magnitude(V_1) / g.V_b


@compiled
def advance_gfm(
    g: Any, P_set: float, V_set: float, x0: Any, x: Any, d: Any, P: float, Q: float, v: float, h: float, second: bool
) -> None:
    """One pass of a step: from what the network solution shows to the next internal voltage.

    Integrator slopes are taken from the filters' values at the end of the pass, in both passes (section 5), as in
    GridLAB-D: the first 20 ms depend on it. Set-points, `P`, `Q`, `v`: pu; `x0`, `x`, `d`: as of `advance_gfl`.
    """
    # measurement filters, 3.2
    dp = (P - x.p) / g.T_p
    dq = (Q - x.q) / g.T_q
    dv = (v - x.v) / g.T_v
    x.p = heun(x0.p, d.p, dp, h, second)
    x.q = heun(x0.q, d.q, dq, h, second)
    x.v = heun(x0.v, d.v, dv, h, second)

    # overload and under-load limiters, 3.3: they only ever slow down or speed up
    over, under = g.P_max - x.p, g.P_min - x.p
    x.x_over = sat(heun(x0.x_over, d.x_over, g.k_ip * over, h, second), -g.w_lim, 0.0)
    x.x_under = sat(heun(x0.x_under, d.x_under, g.k_ip * under, h, second), 0.0, g.w_lim)
    limit = sat(x.x_over + g.k_pp * over, -g.w_lim, 0.0) + sat(x.x_under + g.k_pp * under, 0.0, g.w_lim)

    # reactive limiters and voltage controller, 3.4
    q_over, q_under = g.Q_max - x.q, g.Q_min - x.q
    x.y_over = sat(heun(x0.y_over, d.y_over, g.k_iq * q_over, h, second), -g.V_lim, 0.0)
    x.y_under = sat(heun(x0.y_under, d.y_under, g.k_iq * q_under, h, second), 0.0, g.V_lim)
    q_limit = sat(x.y_over + g.k_pq * q_over, -g.V_lim, 0.0) + sat(x.y_under + g.k_pq * q_under, 0.0, g.V_lim)
    V_ref = V_set - g.m_q * x.q + q_limit
    error = V_ref - x.v
    de = g.k_iv * error if g.voltage_control else 0.0
    x.e = sat(heun(x0.e, d.e, de, h, second), g.E_min, g.E_max)
    x.E = sat(x.e + g.k_pv * error if g.voltage_control else V_ref, g.E_min, g.E_max)

    # droop, 3.3 and equation (3)
    x.w = g.m_p * (P_set - x.p) + limit
    x.theta = heun(x0.theta, d.theta, x.w, h, second)

    if not second:
        d.p, d.q, d.v = dp, dq, dv
        d.x_over, d.x_under = g.k_ip * over, g.k_ip * under
        d.y_over, d.y_under = g.k_iq * q_over, g.k_iq * q_under
        d.e, d.theta = de, x.w
