"""Grid-following inverter: PLL, freq-watt, volt-var, current control (`inverter-models.md` section 4).

In the mode "positive_sequence" there are one PLL, one current reference, and three phase currents driven to it; in the
mode "balanced_power" each phase has its own, so that the powers are equal. Per unit of the own rating; dq in the frame
of the phase's PLL.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.kernel.compiled import A120, Complex, compiled, heun, magnitude, sat, unit_phasor
from gridpeers.plant.plant_config import GflParameters, Method

_NUMBERS = (
    *("X_f", "k_pPLL", "k_iPLL", "k_pc", "k_ic", "F_current", "T_if", "T_ff", "T_pf"),
    *("T_vf", "T_qf", "db_UF", "db_OF", "db_UV", "db_OV", "P_max", "P_min", "S_max"),
    *("Q_max", "Q_min", "i_max"),
)  # of `GflParameters`, as they are

PARAMETERS = np.dtype(
    [
        ("S_b", "f8"),  # VA, three phases
        ("V_b", "f8"),  # V, line-to-neutral
        ("I_b", "f8"),  # A
        ("f_nom", "f8"),  # Hz
        ("w_nom", "f8"),  # rad/s, speed of the common frame
        ("y_f", "c16"),  # S, of one phase, in the network; 0 for a current source
        ("y_e", "c16"),  # S, filter admittance also in the current-source form (unused there)
        ("current_source", "b1"),
        ("balanced_power", "b1"),
        ("from_edge", "b1"),  # a droop begins at the edge of its dead band
        ("frequency_watt", "b1"),
        ("volt_var", "b1"),
        ("R_p", "f8"),  # pu frequency per pu
        ("R_q", "f8"),  # pu voltage per pu
        *((name, "f8") for name in _NUMBERS),
    ],
    align=True,
)

STATE = np.dtype(
    [
        ("w_i", "f8"),  # PLL integrator, rad/s
        ("theta", "f8"),  # PLL angle, rad
        ("w_i_B", "f8"),  # the same of phases B and C, in the mode "balanced_power"
        ("theta_B", "f8"),
        ("w_i_C", "f8"),
        ("theta_C", "f8"),
        ("f_m", "f8"),  # filtered PLL frequency, Hz
        ("P_f", "f8"),  # lagged P reference, pu
        ("V_m", "f8"),  # filtered mean voltage, pu
        ("Q_f", "f8"),  # lagged Q reference, pu
        ("cd_A", "f8"),  # current controller's integrators (voltage source), or lagged currents
        ("cq_A", "f8"),  # (current source), d and q of each phase, pu
        ("cd_B", "f8"),
        ("cq_B", "f8"),
        ("cd_C", "f8"),
        ("cq_C", "f8"),
        ("f", "f8"),  # PLL frequency, mean of the PLLs, Hz (output)
    ],
    align=True,
)


def own_feedback(par: GflParameters) -> complex:
    """Return d i_after / d i_before of the current over one pass, at the same voltage (dq, section 4.6)."""
    return (1j * par.X_f * par.F_current - par.k_pc) / complex(par.R_f, par.X_f)


def filter_admittance(par: GflParameters, S_b: float, V_b: float) -> complex:
    return 1.0 / (complex(par.R_f, par.X_f) * V_b**2 / (S_b / 3.0))


def pack(
    par: GflParameters, S_b: float, V_b: float, m_p: float, m_q: float, f_nom: float, method: Method = "first-order"
) -> NDArray[np.void]:
    """Parameters of one unit as the compiled pass wants them; arguments as of `kernel.gfm.pack`.

    In the method "second-order" the unit is a current source towards the network, in either model. ValueError if the
    current controller's one-pass feedback cannot be stable (checklist row 23).
    """
    if method == "first-order" and par.model == "voltage_source" and abs(own_feedback(par)) >= 1.0:
        raise ValueError(
            f"gfl: abs(j X_f F_current - k_pc) / abs(R_f + j X_f) must be below 1, got {abs(own_feedback(par)):.2f} "
            f"from F_current {par.F_current:g}, k_pc {par.k_pc:g} pu: the current controller would diverge on a "
            'stiff bus; lower F_current or k_pc, use model "current_source", or the method "second-order"'
        )
    y = filter_admittance(par, S_b, V_b)
    record = np.zeros((), PARAMETERS)
    record["S_b"], record["V_b"], record["I_b"] = S_b, V_b, S_b / (3.0 * V_b)
    record["f_nom"], record["w_nom"] = f_nom, 2.0 * np.pi * f_nom
    record["current_source"] = par.model == "current_source"
    record["balanced_power"] = par.mode == "balanced_power"
    record["from_edge"] = par.dead_band == "ieee1547"
    record["y_e"] = y
    record["y_f"] = 0.0 if par.model == "current_source" or method == "second-order" else y
    record["R_p"], record["R_q"] = m_p, m_q
    for name in ("frequency_watt", "volt_var", *_NUMBERS):
        record[name] = getattr(par, name)
    return record


def settle(
    g: np.void,
    state: np.void,
    V: Complex,
    I: Complex,  # noqa: E741  # the paper's symbol
    S: complex,
    v: float,
) -> None:
    """Set a state to rest (section 7) with these voltages (V) and currents (A), power and mean voltage (pu)."""
    theta = float(np.angle(V @ np.array([1.0, A120, A120**2])))
    turn = np.exp(-1j * theta) * np.array([1.0, A120, A120.conjugate()])
    if g["balanced_power"]:
        turn = np.exp(-1j * np.angle(V))
        theta, state["theta_B"], state["theta_C"] = (float(angle) for angle in np.angle(V))
        state["w_i_B"] = state["w_i_C"] = 0.0
    i_dq, u_dq = I * turn / g["I_b"], V * turn / g["V_b"]
    c = i_dq
    if not g["current_source"]:
        e = (I / g["y_e"] + V) * turn / g["V_b"]
        c = e - u_dq - 1j * g["X_f"] * g["F_current"] * i_dq
    state["w_i"], state["theta"] = 0.0, theta
    state["f_m"] = state["f"] = g["f_nom"]
    state["P_f"], state["V_m"], state["Q_f"] = S.real, v, S.imag
    for phase, name in enumerate("ABC"):
        state["cd_" + name], state["cq_" + name] = c[phase].real, c[phase].imag


@compiled
def power_reference(g: Any, P_set: float, f_m: float) -> float:
    """Freq-watt characteristic (7), section 4.3 (pu).

    Outside the dead band the full deviation acts, or `from_edge` that from the edge.
    """
    P_d = P_set
    if g.frequency_watt and not (g.f_nom - g.db_UF < f_m < g.f_nom + g.db_OF):
        edge = 0.0
        if g.from_edge:
            edge = g.db_UF if f_m < g.f_nom else -g.db_OF
        P_d += (g.f_nom - edge - f_m) / (g.f_nom * g.R_p)
    return sat(P_d, g.P_min, g.P_max)


@compiled
def var_reference(g: Any, V_set: float, Q_set: float, V_m: float, P_d: float) -> float:
    """Volt-var characteristic (8) with dead band, within its limits and what P leaves of S_max, section 4.4 (pu)."""
    Q_d = Q_set
    if g.volt_var and not (V_set - g.db_UV < V_m < V_set + g.db_OV):
        edge = 0.0
        if g.from_edge:
            edge = g.db_UV if V_m < V_set else -g.db_OV
        Q_d += (V_set - edge - V_m) / g.R_q
    Q_lim = np.sqrt(max(g.S_max**2 - P_d**2, 0.0))
    return sat(Q_d, max(-Q_lim, g.Q_min), min(Q_lim, g.Q_max))


@compiled
def current_reference(g: Any, P: float, Q: float, u_d: float) -> complex:
    """Current reference i_d + j i_q, equations (5)(6) (pu); below 1e-3 pu there is no voltage to follow."""
    u_d = max(u_d, 1e-3)
    return complex(sat(P / u_d, -g.i_max, g.i_max), sat(-Q / u_d, -g.i_max, g.i_max))


@compiled
def lock_others(
    g: Any, x0: Any, x: Any, d: Any, u_q_B: float, u_q_C: float, h: float, second: bool
) -> tuple[float, float]:
    """Advance the PLLs of phases B and C; return their speeds (rad/s, relative to nominal)."""
    dw_B, dw_C = g.k_iPLL * u_q_B, g.k_iPLL * u_q_C
    x.w_i_B = heun(x0.w_i_B, d.w_i_B, dw_B, h, second)
    x.w_i_C = heun(x0.w_i_C, d.w_i_C, dw_C, h, second)
    w_B, w_C = x.w_i_B + g.k_pPLL * u_q_B, x.w_i_C + g.k_pPLL * u_q_C
    x.theta_B = heun(x0.theta_B, d.theta_B, w_B, h, second)
    x.theta_C = heun(x0.theta_C, d.theta_C, w_C, h, second)
    if not second:
        d.w_i_B, d.theta_B, d.w_i_C, d.theta_C = dw_B, w_B, dw_C, w_C
    return w_B, w_C


@compiled
def current_pass(
    g: Any, c0: complex, c: complex, d1: complex, i_ref: complex, i: complex, u: complex, h: float, second: bool
) -> tuple[complex, complex, complex]:
    """One phase's current controller: new integrator, output (e, or i of a current source), slope (4.6, 4.7; pu)."""
    slope = (i_ref - c) * (1.0 / g.T_if) if g.current_source else g.k_ic * (i_ref - i)
    c_new = c0 + 0.5 * h * (d1 + slope) if second else c0 + h * slope
    if g.current_source:
        return c_new, c_new, slope
    return c_new, c_new + g.k_pc * (i_ref - i) + u + 1j * g.X_f * g.F_current * i, slope


@compiled
def advance_gfl(
    g: Any,
    P_set: float,
    V_set: float,
    Q_set: float,
    x0: Any,
    x: Any,
    d: Any,
    V_A: complex,
    V_B: complex,
    V_C: complex,
    J_A: complex,
    J_B: complex,
    J_C: complex,
    h: float,
    second: bool,
) -> tuple[complex, complex, complex]:
    """One pass of a step, in the order of blocks of section 5; returns the injections (A) of the next network solution.

    `P_set`, `V_set`, `Q_set`: pu; `x0`, `x`, `d`: records of `STATE`: start of the step; trial state, advanced here;
    slopes of the first pass; V (V) and J (A): of the last network solution.
    """
    # 1: measure in the frame the pass starts with
    to_dq = unit_phasor(-x.theta)
    to_dq_B, to_dq_C = to_dq * A120, to_dq * A120.conjugate()
    if g.balanced_power:
        to_dq_B, to_dq_C = unit_phasor(-x.theta_B), unit_phasor(-x.theta_C)
    per_V, per_I = 1.0 / g.V_b, 1.0 / g.I_b  # numba divides a phasor by a number as by a phasor
    u_A, u_B, u_C = V_A * (to_dq * per_V), V_B * (to_dq_B * per_V), V_C * (to_dq_C * per_V)
    u = (u_A + u_B + u_C) * (1.0 / 3.0)  # the positive sequence in the frame of phase A
    i_A = (J_A - g.y_f * V_A) * (to_dq * per_I)
    i_B = (J_B - g.y_f * V_B) * (to_dq_B * per_I)
    i_C = (J_C - g.y_f * V_C) * (to_dq_C * per_I)
    v = (magnitude(V_A) + magnitude(V_B) + magnitude(V_C)) / (3.0 * g.V_b)

    # 2: PLL
    u_q = u_A.imag if g.balanced_power else u.imag
    dw = g.k_iPLL * u_q
    x.w_i = heun(x0.w_i, d.w_i, dw, h, second)
    w = x.w_i + g.k_pPLL * u_q
    x.theta = heun(x0.theta, d.theta, w, h, second)
    x.f = (g.w_nom + w) / (2.0 * np.pi)
    if g.balanced_power:
        w_B, w_C = lock_others(g, x0, x, d, u_B.imag, u_C.imag, h, second)
        x.f = (g.w_nom + (w + w_B + w_C) / 3.0) / (2.0 * np.pi)

    # 3 to 6: frequency filter, freq-watt, voltage filter, volt-var, each lag fed by this pass' value
    df = (x.f - x.f_m) / g.T_ff
    x.f_m = heun(x0.f_m, d.f_m, df, h, second)
    P_d = power_reference(g, P_set, x.f_m)
    dP = (P_d - x.P_f) / g.T_pf
    x.P_f = heun(x0.P_f, d.P_f, dP, h, second)
    P_c = x.P_f if g.frequency_watt else P_d
    dV = (v - x.V_m) / g.T_vf
    x.V_m = heun(x0.V_m, d.V_m, dV, h, second)
    Q_d = var_reference(g, V_set, Q_set, x.V_m, P_d)
    dQ = (Q_d - x.Q_f) / g.T_qf
    x.Q_f = heun(x0.Q_f, d.Q_f, dQ, h, second)
    Q_c = x.Q_f if g.volt_var else Q_d

    # 7: current references
    if g.balanced_power:
        ref_A = current_reference(g, P_c, Q_c, u_A.real)
        ref_B, ref_C = current_reference(g, P_c, Q_c, u_B.real), current_reference(g, P_c, Q_c, u_C.real)
    else:
        ref_A = ref_B = ref_C = current_reference(g, P_c, Q_c, u.real)

    # 8: current controllers
    c_A, out_A, s_A = current_pass(
        g, complex(x0.cd_A, x0.cq_A), complex(x.cd_A, x.cq_A), complex(d.cd_A, d.cq_A), ref_A, i_A, u_A, h, second
    )
    c_B, out_B, s_B = current_pass(
        g, complex(x0.cd_B, x0.cq_B), complex(x.cd_B, x.cq_B), complex(d.cd_B, d.cq_B), ref_B, i_B, u_B, h, second
    )
    c_C, out_C, s_C = current_pass(
        g, complex(x0.cd_C, x0.cq_C), complex(x.cd_C, x.cq_C), complex(d.cd_C, d.cq_C), ref_C, i_C, u_C, h, second
    )
    x.cd_A, x.cq_A, x.cd_B, x.cq_B, x.cd_C, x.cq_C = c_A.real, c_A.imag, c_B.real, c_B.imag, c_C.real, c_C.imag

    if not second:
        d.w_i, d.theta, d.f_m, d.P_f, d.V_m, d.Q_f = dw, w, df, dP, dV, dQ
        d.cd_A, d.cq_A, d.cd_B, d.cq_B, d.cd_C, d.cq_C = s_A.real, s_A.imag, s_B.real, s_B.imag, s_C.real, s_C.imag

    # 9: back with the new angle
    scale = g.I_b if g.current_source else g.V_b * g.y_e
    turn = unit_phasor(x.theta) * scale
    if g.balanced_power:
        return out_A * turn, out_B * unit_phasor(x.theta_B) * scale, out_C * unit_phasor(x.theta_C) * scale
    return out_A * turn, out_B * turn * A120.conjugate(), out_C * turn * A120
