"""Virtual synchronous machine: an inverter with the swing equation of a machine, inertia H and damping D.

S. D'Arco, J. A. Suul: Equivalence of virtual synchronous machines and frequency-droops for converter-based microgrids,
IEEE Transactions on Smart Grid 5(1), 2014, 394-395, https://doi.org/10.1109/TSG.2013.2288000. The power that the
machine gets is P_set less the droop of its speed; reactive power acts on the internal voltage through a filter:

    2 H d(w/w_nom)/dt = P_set - w/m_p - p - D w/w_nom,    d theta/dt = w
    T_q dq/dt = Q - q,                                     E = V_set - m_q q

Per unit of the own rating; w is the speed relative to nominal (rad/s), m_p is in rad/s per pu.
"""

from __future__ import annotations

from cmath import phase
from math import pi
from typing import Annotated, Any, ClassVar

from gridpeers.plant.inverters.inverter_model import InverterModel, PhaseCurrent, TimeConstant, heun, inject
from gridpeers.wire.schema.table_schema import Plausible, Unit


class Vsm(InverterModel, frozen=True, kw_only=True):
    """Virtual synchronous machine: swing equation with inertia and damping, reactive droop of the internal voltage."""

    model: str = "vsm"
    H: Annotated[float, Unit("s"), Plausible("an inertia constant", 0.005, 20.0, above_zero=True)] = 0.1
    """Inertia constant (s): energy of the machine at nominal speed over its rating."""
    D: Annotated[float, Unit("pu"), Plausible("a damping", 0.0, 1000.0)] = 0.0
    """Damping (pu power per pu speed), beside 1/m_p: the droop at rest is 1/(1/m_p + D)."""
    T_q: Annotated[TimeConstant, "Filter of measured Q (s)."] = 0.02
    I_max: PhaseCurrent = 2.0
    """Largest current of a phase (pu of the rating); a larger one is limited, at the same angle."""

    STATES: ClassVar[tuple[str, ...]] = ("q",)  # filtered reactive power, pu

    @staticmethod
    def advance(g: Any, t: Any, x0: Any, x: Any, d: Any, h: float, second: bool) -> None:
        dw = (t.P_set - x.w / g.m_p - t.P - g.D * x.w / g.w_nom) * g.w_nom / (2.0 * g.H)
        dtheta = x.w
        dq = (t.Q - x.q) / g.T_q
        x.w = heun(x0.w, d.w, dw, h, second)
        x.theta = heun(x0.theta, d.theta, dtheta, h, second)
        x.q = heun(x0.q, d.q, dq, h, second)
        if not second:
            d.w, d.theta, d.q = dw, dtheta, dq
        x.f = (g.w_nom + x.w) / (2.0 * pi)
        inject(g, t, t.V_set - g.m_q * x.q, x.theta)

    @staticmethod
    def rest(g: Any, x: Any, V: Any, I: Any, J: Any, S: complex, v: float) -> None:  # noqa: E741
        x["q"], x["theta"] = S.imag, phase(J[0] / g["y_f"])

    @property
    def holds_terminal(self) -> bool:
        return False  # V_set - m_q q is the internal voltage
