"""Grid-following inverter: PLL, freq-watt, volt-var and current control, as GridLAB-D's `inverter_dyn`.

All is per unit of the own rating; x_dq = x exp(-j theta) in the frame of the PLL; speeds in rad/s relative to nominal.
In the mode "positive_sequence" (GridLAB-D's POSITIVE_SEQUENCE) one PLL follows V_1, and three phase currents follow one
reference. In the mode "balanced_power" each phase has its own PLL and reference, so that powers are equal.

    PLL            dw_i/dt = k_iPLL u_q,  w = w_i + k_pPLL u_q,  d theta/dt = w,  f = f_nom + w / (2 pi)
    freq-watt      T_ff df_m/dt = f - f_m                           f: mean of the PLLs
                   P_d = sat(P_set + (f_nom - f_m) / (f_nom R_p), P_min, P_max),  T_pf dP_f/dt = P_d - P_f
    volt-var       T_vf dV_m/dt = V - V_m                           V: mean of the three magnitudes
                   Q_d = Q_set + (V_set - V_m) / R_q within Q_min, Q_max and +-sqrt(S_max^2 - P_d^2)
                   T_qf dQ_f/dt = Q_d - Q_f
    references     i_d* = sat(P_f / u_d, -i_max, i_max),  i_q* = sat(-Q_f / u_d, -i_max, i_max)
    voltage source dc/dt = k_ic (i* - i),  e = c + k_pc (i* - i) + u + j X_f F_current i,  J = e V_b exp(j theta) y_f
    current source T_if dc/dt = i* - c,  J = c I_b exp(j theta)     no filter, no current controller

R_p and R_q are the droops m_p and m_q of the inverter, in pu. P_set is clipped at P_set_lim before the droop is added.
Within a dead band the reference is the set-point. Beyond it the full deviation acts, as in GridLAB-D, so the reference
jumps at the edge by db / (f_nom R_p) or db / R_q. With dead_band "ieee1547" the deviation from the edge acts, as in
IEEE 1547-2018; V2 = V_set - db_UV, V1 = V2 - R_q Q_max, V3 = V_set + db_OV, V4 = V3 - R_q Q_min are its points.
Without `frequency_watt` or `volt_var` the reference is P_d or Q_d itself, without its lag and droop.

The feed-forward of u and the gains k_pc and F_current act one pass late in the first-order method. On a stiff bus that
converges if abs(j X_f F_current - k_pc) < abs(R_f + j X_f); with network impedance z_g the factor of a pass is
abs(z_g + j X_f F_current - k_pc) / abs(z_g + R_f + j X_f).
"""

from __future__ import annotations

from math import inf, pi, sqrt
from typing import Annotated, Any, ClassVar, Literal

from gridpeers.plant.inverters.inverter_model import (
    A120,
    BoundOfPset,
    FollowerLag,
    Gain,
    InverterModel,
    Kind,
    LimitOfP,
    LimitOfQ,
    Method,
    Resistance,
    TimeConstant,
    UnitRating,
    VoltVar,
    compiled,
    heun,
    magnitude,
    sat,
    unit_phasor,
)
from gridpeers.wire.schema.table_schema import Below, Plausible, Unit

Capacity = Annotated[float, Unit("pu"), Plausible("a limit of apparent power or current", 0.1, 5.0, above_zero=True)]
VoltageBand = Annotated[float, Unit("pu"), Plausible("a dead band", 0.0, 0.2)]
FrequencyBand = Annotated[float, Unit("Hz"), Plausible("a dead band", 0.0, 5.0)]


@compiled
def power_reference(g: Any, P_set: float, f_m: float) -> float:
    """Return the reference of the freq-watt characteristic (7), per unit."""
    P_d = P_set
    if g.frequency_watt and not (g.f_nom - g.db_UF < f_m < g.f_nom + g.db_OF):
        edge = 0.0
        if g.from_edge:
            edge = g.db_UF if f_m < g.f_nom else -g.db_OF
        P_d += (g.f_nom - edge - f_m) / (g.f_nom * g.R_p)
    return sat(P_d, g.P_min, g.P_max)


@compiled
def var_reference(g: Any, V_set: float, Q_set: float, V_m: float, P_d: float) -> float:
    """Return the reference of the volt-var characteristic (8), within its limits and what P leaves of S_max (pu)."""
    Q_d = Q_set
    if g.volt_var and not (V_set - g.db_UV < V_m < V_set + g.db_OV):
        edge = 0.0
        if g.from_edge:
            edge = g.db_UV if V_m < V_set else -g.db_OV
        Q_d += (V_set - edge - V_m) / g.R_q
    Q_lim = sqrt(max(g.S_max**2 - P_d**2, 0.0))
    return sat(Q_d, max(-Q_lim, g.Q_min), min(Q_lim, g.Q_max))


@compiled
def current_reference(g: Any, P: float, Q: float, u_d: float) -> complex:
    """Current reference i_d + j i_q, equations (5)(6) (pu); below 1e-3 pu there is no voltage to follow."""
    u_d = max(u_d, 1e-3)
    return complex(sat(P / u_d, -g.i_max, g.i_max), sat(-Q / u_d, -g.i_max, g.i_max))


@compiled
def lock(
    g: Any, w_i0: float, theta0: float, w_i1: float, theta1: float, u_q: float, h: float, second: bool
) -> tuple[float, float, float, float]:
    """Advance a PLL; return its integrator and angle, and their slopes, of which the second is its speed (rad/s)."""
    dw = g.k_iPLL * u_q
    w_i = heun(w_i0, w_i1, dw, h, second)
    w = w_i + g.k_pPLL * u_q
    return w_i, heun(theta0, theta1, w, h, second), dw, w


@compiled
def current_pass(
    g: Any, c0: complex, c: complex, d1: complex, i_ref: complex, i: complex, u: complex, h: float, second: bool
) -> tuple[complex, complex, complex]:
    """Advance a phase's current controller; return its integrator, its output (e, or a current) and its slope (pu)."""
    slope = (i_ref - c) * (1.0 / g.T_if) if g.current_source else g.k_ic * (i_ref - i)
    c_new = c0 + 0.5 * h * (d1 + slope) if second else c0 + h * slope
    if g.current_source:
        return c_new, c_new, slope
    return c_new, c_new + g.k_pc * (i_ref - i) + u + 1j * g.X_f * g.F_current * i, slope


class Gfl(InverterModel, frozen=True, kw_only=True):
    """Grid-following inverter, per unit of its own rating; its equations are in `plant/inverters/gfl.py`."""

    model: str = "voltage_source"
    """Model: "voltage_source" or "current_source", as seen from the network; or one of your own, `module:Class`."""
    mode: Literal["positive_sequence", "balanced_power"] = "positive_sequence"
    """"positive_sequence": one PLL and balanced currents. "balanced_power": a PLL for each phase and equal power in
    each."""
    R_f: Annotated[Resistance, "Filter resistance (pu)."] = 0.01
    k_pPLL: Annotated[Gain, Unit("rad/s per pu"), "PLL proportional gain (rad/s per pu)."] = 50.0
    k_iPLL: Annotated[Gain, Unit("rad/s^2 per pu"), "PLL integral gain (rad/s^2 per pu)."] = 900.0
    k_pc: Annotated[Gain, Unit("pu", in_key=False), "Current controller, proportional (pu)."] = 0.05
    k_ic: Annotated[Gain, Unit("1/s"), "Current controller, integral (1/s)."] = 5.0
    F_current: Annotated[float, Plausible("the cross-coupling gain F_current", 0.0, 1.0)] = 0.6
    """Cross-coupling gain: 0 oscillates on this feeder; 1 diverges in the first-order method."""
    T_if: Annotated[TimeConstant, "Current lag of the current-source form (s)."] = 0.005
    frequency_watt: Annotated[bool, "Frequency-watt droop on."] = True
    volt_var: Annotated[bool, "Volt-var droop on."] = True
    T_ff: Annotated[TimeConstant, "Filter of the PLL frequency (s)."] = 0.02
    T_pf: TimeConstant = 0.05
    """Lag of the P reference (s). GridLAB-D's default 0.5 s is too slow for consensus in 1 s."""
    T_vf: Annotated[TimeConstant, "Filter of measured V (s)."] = 0.05
    T_qf: TimeConstant = 0.1
    """Lag of the Q reference (s). 5 % droop is a gain of 20 from V to Q. With T_vf_s = 0.02 and T_qf_s = 0.05, one GFM
    with four GFL oscillates on this feeder. GridLAB-D's 0.2 s only slows the sharing of vars."""
    db_UF: Annotated[FrequencyBand, "Dead band below nominal frequency (Hz)."] = 0.0
    db_OF: Annotated[FrequencyBand, "Dead band above nominal frequency (Hz)."] = 0.0
    db_UV: Annotated[VoltageBand, "Dead band below V_set (pu)."] = 0.0
    db_OV: Annotated[VoltageBand, "Dead band above V_set (pu)."] = 0.0
    dead_band: Literal["gridlabd", "ieee1547"] = "gridlabd"
    """Droop of frequency and voltage outside a dead band: "gridlabd", by the full deviation, with a jump at the edge;
    or "ieee1547", by the deviation from the edge."""
    P_max: Annotated[LimitOfP, "Upper bound of the P reference (pu)."] = 1.0
    P_min: Annotated[LimitOfP, Below("P_max"), "Lower bound of the P reference (pu)."] = -1.0
    S_max: Annotated[Capacity, "Apparent-power limit (pu of the rating): bounds Q at sqrt(S_max^2 - P^2)."] = 1.2
    Q_max: Annotated[LimitOfQ, "Upper bound of the Q reference (pu): Q1 of IEEE 1547-2018."] = 10.0
    Q_min: Annotated[LimitOfQ, Below("Q_max"), "Lower bound of the Q reference (pu): Q4 of IEEE 1547-2018."] = -10.0
    i_max: Annotated[Capacity, "Bound of each axis of the current reference (pu)."] = 1.2
    P_set_lim: BoundOfPset = 1.0
    """Limit of abs(P_set) (pu), before the droop (7) is added; 1 is the rating, as in GridLAB-D. With a larger limit, a
    wound-up set-point delays the response of the inverter."""

    kind: ClassVar[Kind] = "GFL"
    STATES: ClassVar[tuple[str, ...]] = (
        *("w_i", "w_i_B", "theta_B", "w_i_C", "theta_C", "f_m", "P_f", "V_m", "Q_f"),
        *("cd_A", "cq_A", "cd_B", "cq_B", "cd_C", "cq_C"),
    )
    """PLL integrator (rad/s), and those of phases B and C with their angles (rad) in the mode "balanced_power";
    filtered PLL frequency (Hz), lagged P, filtered mean voltage, lagged Q (pu); d and q of each phase: integrators of
    the current controller (voltage source), or lagged currents (current source), pu."""
    LIMITS_OF_P: ClassVar[tuple[str, ...]] = ("P_max", "S_max", "i_max", "P_set_lim", "P_min")

    @staticmethod
    def advance(g: Any, t: Any, x0: Any, x: Any, d: Any, h: float, second: bool) -> None:
        """Take the blocks in GridLAB-D's order: each lag uses the value that this pass has just found."""
        V_A, V_B, V_C, J_A, J_B, J_C = t.V_A, t.V_B, t.V_C, t.J_A, t.J_B, t.J_C
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
        x.w_i, x.theta, dw, w = lock(g, x0.w_i, x0.theta, d.w_i, d.theta, u_q, h, second)
        x.w = w
        if g.balanced_power:
            x.w_i_B, x.theta_B, dw_B, w_B = lock(g, x0.w_i_B, x0.theta_B, d.w_i_B, d.theta_B, u_B.imag, h, second)
            x.w_i_C, x.theta_C, dw_C, w_C = lock(g, x0.w_i_C, x0.theta_C, d.w_i_C, d.theta_C, u_C.imag, h, second)
            if not second:
                d.w_i_B, d.theta_B, d.w_i_C, d.theta_C = dw_B, w_B, dw_C, w_C
            x.w = (w + w_B + w_C) / 3.0
        x.f = (g.w_nom + x.w) / (2.0 * pi)

        # 3 to 6: frequency filter, freq-watt, voltage filter, volt-var, each lag fed by this pass' value
        df = (x.f - x.f_m) / g.T_ff
        x.f_m = heun(x0.f_m, d.f_m, df, h, second)
        P_d = power_reference(g, t.P_set, x.f_m)
        dP = (P_d - x.P_f) / g.T_pf
        x.P_f = heun(x0.P_f, d.P_f, dP, h, second)
        P_c = x.P_f if g.frequency_watt else P_d
        dV = (v - x.V_m) / g.T_vf
        x.V_m = heun(x0.V_m, d.V_m, dV, h, second)
        Q_d = var_reference(g, t.V_set, t.Q_set, x.V_m, P_d)
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
            t.J_A = out_A * turn
            t.J_B, t.J_C = out_B * unit_phasor(x.theta_B) * scale, out_C * unit_phasor(x.theta_C) * scale
        else:
            t.J_A, t.J_B, t.J_C = out_A * turn, out_B * turn * A120.conjugate(), out_C * turn * A120

    @staticmethod
    def rest(g: Any, x: Any, V: Any, I: Any, J: Any, S: complex, v: float) -> None:  # noqa: E741
        import numpy as np  # not at the top: scenarios are checked without it

        theta = float(np.angle(V @ np.array([1.0, A120, A120**2])))
        turn = np.exp(-1j * theta) * np.array([1.0, A120, A120.conjugate()])
        if g["balanced_power"]:
            turn = np.exp(-1j * np.angle(V))
            theta, x["theta_B"], x["theta_C"] = (float(angle) for angle in np.angle(V))
            x["w_i_B"] = x["w_i_C"] = 0.0
        i_dq, u_dq = I * turn / g["I_b"], V * turn / g["V_b"]
        c = i_dq
        if not g["current_source"]:
            e = (I / g["y_e"] + V) * turn / g["V_b"]
            c = e - u_dq - 1j * g["X_f"] * g["F_current"] * i_dq
        x["w_i"], x["theta"], x["f_m"] = 0.0, theta, x["f"]
        x["P_f"], x["V_m"], x["Q_f"] = S.real, v, S.imag
        for phase, name in enumerate("ABC"):
            x["cd_" + name], x["cq_" + name] = c[phase].real, c[phase].imag

    @staticmethod
    def locked(x: Any, w: float, f: float) -> None:
        x["w_i"] = x["w_i_B"] = x["w_i_C"] = w
        x["f_m"] = f

    def constants(self, rating: UnitRating) -> dict[str, float | complex | bool]:
        return {
            "y_e": self._filter(rating),  # S, filter admittance also in the current-source form (unused there)
            "current_source": self.model == "current_source",
            "balanced_power": self.equal_powers,
            "from_edge": self.volt_var_at_rest().from_edge,  # a droop begins at the edge of its dead band
            "R_p": rating.m_p,  # pu frequency per pu
            "R_q": rating.m_q,  # pu voltage per pu
        }

    def _filter(self, rating: UnitRating) -> complex:
        return 1.0 / (complex(self.R_f, self.X_f) * rating.V_b**2 / (rating.S_b / 3.0))

    def admittance(self, rating: UnitRating) -> complex:
        return 0.0j if self.model == "current_source" else self._filter(rating)

    def feedback(self) -> complex | None:
        """Return the slope of a voltage source's current controller."""
        if self.model == "current_source":
            return None
        return (1j * self.X_f * self.F_current - self.k_pc) / complex(self.R_f, self.X_f)

    def volt_var_at_rest(self) -> VoltVar:
        bands = (self.db_UV, self.db_OV) if self.volt_var else (inf, inf)
        return VoltVar(self.S_max, self.Q_min, self.Q_max, *bands, self.dead_band == "ieee1547")

    @property
    def equal_powers(self) -> bool:
        return self.mode == "balanced_power"

    def objection(self, method: Method) -> str:
        """Refuse a current controller that diverges on a stiff bus in the first-order method."""
        slope = self.feedback()
        if method == "second-order" or slope is None or abs(slope) < 1.0:
            return ""
        return (
            f"gfl: abs(j X_f F_current - k_pc) / abs(R_f + j X_f) must be below 1, got {abs(slope):.2f} "
            f"from F_current {self.F_current:g}, k_pc {self.k_pc:g} pu: the current controller would diverge on a "
            'stiff bus; lower F_current or k_pc, use model "current_source", or the method "second-order"'
        )

    def time_constants(self) -> dict[str, float]:
        names = ("T_ff", "T_pf", "T_vf", "T_qf", *(("T_if",) if self.model == "current_source" else ()))
        return {name: getattr(self, name) for name in names}

    def beyond_gridlabd(self) -> dict[str, str]:
        found = {} if self.dead_band == "gridlabd" else {"dead_band": f'"{self.dead_band}"'}
        for key in ("Q_max", "Q_min"):  # GridLAB-D overwrites its own with what P leaves
            if getattr(self, key) != getattr(Gfl(), key):
                found[f"{key}_pu"] = f"{getattr(self, key):g}"
        return found

    def response(self) -> FollowerLag:
        return FollowerLag(self.k_pPLL, self.k_iPLL, self.T_ff, self.T_pf, self.frequency_watt)
