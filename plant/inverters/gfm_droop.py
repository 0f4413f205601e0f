"""Grid-forming inverter with droop, limiters and voltage controller, as GridLAB-D's `inverter_dyn` (GRID_FORMING).

One controller serves three phases: a balanced internal voltage E at the angle theta, behind the filter. All is per unit
of the own rating; speeds are in rad/s relative to nominal, w_nom = 2 pi f_nom; sat(x, a, b) bounds x.

    filters        T_p dp/dt = P - p,  T_q dq/dt = Q - q,  T_v dv/dt = V - v    V: mean of the three magnitudes
    P limiters     dx+/dt = k_ip (P_max - p) in [-w_lim, 0],  O+ = sat(x+ + k_pp (P_max - p), -w_lim, 0)
                   dx-/dt = k_ip (P_min - p) in [0, w_lim],   O- = sat(x- + k_pp (P_min - p), 0, w_lim)
    P-f droop      w = m_p (P_set - p) + O+ + O-,  d theta/dt = w,  f = (w_nom + w) / (2 pi)
    Q limiters     dy+/dt = k_iq (Q_max - q) in [-V_lim, 0],  U+ = sat(y+ + k_pq (Q_max - q), -V_lim, 0)
                   dy-/dt = k_iq (Q_min - q) in [0, V_lim],   U- = sat(y- + k_pq (Q_min - q), 0, V_lim)
    Q-V droop      V_ref = V_set - m_q q + U+ + U-
    voltage        de/dt = k_iv (V_ref - v) in [E_min, E_max],  E = sat(e + k_pv (V_ref - v), E_min, E_max);
                   without `voltage_control` E = sat(V_ref, E_min, E_max)
    injection      J = E V_b exp(j theta) y_f in phase A, -120 and 120 degrees from it in B and C

m_p is in rad/s per pu: 1 % of 60 Hz is 3.77. O+ only lowers the frequency, and O- only raises it: a limiter caps no
power, it slows the unit until other sources take the excess. The controller holds the terminal's mean magnitude, not E.
A phase whose current exceeds I_max keeps its angle and loses the surplus (`plant/dynamics/kernel/step.py`), and the
controller's states go on. At rest every derivative is zero: E and theta are those of the power flow, and p = P_set.
"""

from __future__ import annotations

from math import pi
from typing import Annotated, Any, ClassVar

from gridpeers.plant.inverters.inverter_model import (
    DroopLag,
    Gain,
    InverterModel,
    LimitOfP,
    LimitOfQ,
    PhaseCurrent,
    TimeConstant,
    compiled,
    heun,
    inject,
    sat,
)
from gridpeers.wire.schema.table_schema import Below, Plausible, Unit

InternalVoltage = Annotated[float, Unit("pu"), Plausible("a limit of the internal voltage", 0.0, 2.0)]


@compiled
def advance_droop(
    g: Any, t: Any, x0: Any, x: Any, d: Any, P: float, Q: float, v: float, h: float, second: bool
) -> None:
    """Take one pass with the measured power and voltage P, Q, v (pu).

    Integrator slopes come from the filters' values at the end of the pass, in both passes, as in GridLAB-D. The first
    20 ms depend on it.
    """
    # measurement filters
    dp = (P - x.p) / g.T_p
    dq = (Q - x.q) / g.T_q
    dv = (v - x.v) / g.T_v
    x.p = heun(x0.p, d.p, dp, h, second)
    x.q = heun(x0.q, d.q, dq, h, second)
    x.v = heun(x0.v, d.v, dv, h, second)

    # overload and under-load limiters
    over, under = g.P_max - x.p, g.P_min - x.p
    x.x_over = sat(heun(x0.x_over, d.x_over, g.k_ip * over, h, second), -g.w_lim, 0.0)
    x.x_under = sat(heun(x0.x_under, d.x_under, g.k_ip * under, h, second), 0.0, g.w_lim)
    limit = sat(x.x_over + g.k_pp * over, -g.w_lim, 0.0) + sat(x.x_under + g.k_pp * under, 0.0, g.w_lim)

    # reactive limiters, Q-V droop and voltage controller
    q_over, q_under = g.Q_max - x.q, g.Q_min - x.q
    x.y_over = sat(heun(x0.y_over, d.y_over, g.k_iq * q_over, h, second), -g.V_lim, 0.0)
    x.y_under = sat(heun(x0.y_under, d.y_under, g.k_iq * q_under, h, second), 0.0, g.V_lim)
    q_limit = sat(x.y_over + g.k_pq * q_over, -g.V_lim, 0.0) + sat(x.y_under + g.k_pq * q_under, 0.0, g.V_lim)
    V_ref = t.V_set - g.m_q * x.q + q_limit
    error = V_ref - x.v
    de = g.k_iv * error if g.voltage_control else 0.0
    x.e = sat(heun(x0.e, d.e, de, h, second), g.E_min, g.E_max)
    x.E = sat(x.e + g.k_pv * error if g.voltage_control else V_ref, g.E_min, g.E_max)

    # P-f droop, equation (3)
    x.w = g.m_p * (t.P_set - x.p) + limit
    x.theta = heun(x0.theta, d.theta, x.w, h, second)
    x.f = g.f_nom + x.w / (2.0 * pi)
    inject(g, t, x.E, x.theta)

    if not second:
        d.p, d.q, d.v = dp, dq, dv
        d.x_over, d.x_under = g.k_ip * over, g.k_ip * under
        d.y_over, d.y_under = g.k_iq * q_over, g.k_iq * q_under
        d.e, d.theta = de, x.w


class GfmDroop(InverterModel, frozen=True, kw_only=True):
    """Grid-forming inverter, per unit of its own rating; its equations are in `plant/inverters/gfm_droop.py`."""

    model: str = "gridlabd"
    """Which model: "gridlabd", GridLAB-D's droop with limiters; "regfm_a1", the same, with power and voltage of the
    positive sequence; "vsm", a virtual synchronous machine; or one of your own, `module:Class`."""
    voltage_control: bool = True
    """true: the Q-V droop gives the terminal voltage, and a controller holds it; false: the droop gives the internal
    voltage (VFlag = 0 of REGFM_A1)."""
    T_p: Annotated[TimeConstant, "Filter of measured P (s)."] = 0.01
    T_q: Annotated[TimeConstant, "Filter of measured Q (s)."] = 0.01
    T_v: Annotated[TimeConstant, "Filter of measured V (s)."] = 0.01
    P_max: Annotated[LimitOfP, "Overload limit (pu)."] = 1.0
    P_min: Annotated[LimitOfP, Below("P_max"), "Under-load limit (pu)."] = 0.0
    k_pp: Annotated[Gain, Unit("rad/s per pu"), "Proportional gain of the P limiters (rad/s per pu)."] = 3.0
    k_ip: Annotated[Gain, Unit("rad/s^2 per pu"), "Integral gain of the P limiters (rad/s^2 per pu)."] = 60.0
    w_lim: Annotated[float, Unit("rad/s"), Plausible("the limiters' bound w_lim", 0.1, 1e4, above_zero=True)] = 200.0
    """Bound of the P limiters' output (rad/s)."""
    Q_max: Annotated[LimitOfQ, "Upper reactive limit (pu)."] = 10.0
    Q_min: Annotated[LimitOfQ, Below("Q_max"), "Lower reactive limit (pu)."] = -10.0
    k_pq: Annotated[Gain, Unit("pu V per pu"), "Proportional gain of the Q limiters (pu V per pu)."] = 3.0
    k_iq: Annotated[Gain, Unit("pu V per pu s"), "Integral gain of the Q limiters (pu V per pu s)."] = 20.0
    V_lim: Annotated[float, Unit("pu"), Plausible("the limiters' bound V_lim", 0.01, 10.0, above_zero=True)] = 10.0
    """Bound of the Q limiters' output (pu V)."""
    k_pv: Annotated[Gain, "Proportional gain of the voltage controller."] = 0.0
    k_iv: Annotated[Gain, Unit("1/s"), "Integral gain of the voltage controller (1/s)."] = 5.86
    E_min: Annotated[InternalVoltage, Below("E_max"), "Lower bound of the internal voltage (pu)."] = 0.0
    E_max: Annotated[InternalVoltage, "Upper bound of the internal voltage (pu)."] = 1.25
    I_max: PhaseCurrent = 2.0
    """Largest current of a phase (pu of the rating); a larger one is limited, at the same angle."""

    STATES: ClassVar[tuple[str, ...]] = ("p", "q", "v", "x_over", "x_under", "y_over", "y_under", "e", "E")
    """Filtered P, Q and mean V (pu); integrators of the limiters of P (rad/s) and Q (pu V): x_over, y_over <= 0 <=
    x_under, y_under; integrator of the voltage controller, and internal voltage, an output (pu)."""
    LIMITS_OF_P: ClassVar[tuple[str, ...]] = ("P_max", "P_set_lim", "P_min")
    BOUNDS_AT_REST: ClassVar[tuple[tuple[str, str, str, str], ...]] = (
        ("P", "kW", "P_min", "P_max"),
        ("Q", "kvar", "Q_min", "Q_max"),
        ("E", "pu", "E_min", "E_max"),
    )

    @staticmethod
    def advance(g: Any, t: Any, x0: Any, x: Any, d: Any, h: float, second: bool) -> None:
        advance_droop(g, t, x0, x, d, t.P, t.Q, t.V, h, second)

    @staticmethod
    def rest(g: Any, x: Any, V: Any, I: Any, J: Any, S: complex, v: float) -> None:  # noqa: E741
        import numpy as np  # not at the top: scenarios are checked without it

        E = J[0] / g["y_f"]
        x["p"], x["q"], x["v"] = S.real, S.imag, v
        x["x_over"] = x["x_under"] = x["y_over"] = x["y_under"] = 0.0
        x["e"] = x["E"] = abs(E) / g["V_b"]
        x["theta"] = np.angle(E)

    @property
    def holds_terminal(self) -> bool:
        return self.voltage_control

    def beyond_gridlabd(self) -> dict[str, str]:
        found = {} if self.model == "gridlabd" else super().beyond_gridlabd()
        if not self.voltage_control:
            found["voltage_control"] = "false"
        if self.V_lim != GfmDroop().V_lim:  # fixed in GridLAB-D
            found["V_lim_pu"] = f"{self.V_lim:g}"
        return found

    def response(self) -> DroopLag:
        return DroopLag(self.T_p)
