"""REGFM_A1, WECC's generic model of a droop-controlled grid-forming inverter.

W. Du et al., Model Specification of Droop-Controlled, Grid-Forming Inverters (REGFM_A1), PNNL. Its blocks are those of
`gfm_droop.py`: lags, both droops, four PI limiters, the PI voltage controller and a voltage behind X_L. It differs in
what it measures, the positive sequence:

    T_p dp/dt = Re(3 V_1 I_1*) / S_b - p,  T_q dq/dt = Im(3 V_1 I_1*) / S_b - q,  T_v dv/dt = abs(V_1) / V_b - v

VFlag = 1 is `voltage_control`; with VFlag = 0 the Q-V droop gives E. On balanced phases it equals the model "gridlabd".
On unequal phases the negative and zero sequences pass X_L, and no droop or limiter answers them. ImaxF is a limit of
the positive sequence; here I_max bounds each phase. `kppmax` and `kipmax` of the specification are per unit of
frequency: k_pp = 2 pi f_nom kppmax, k_ip = 2 pi f_nom kipmax. Q_set is 0; another Q_set is V_set + m_q Q_set.
Written from the block diagram as PSTess and GridKit have it; no published trace exists to compare with.
"""

from __future__ import annotations

from math import pi
from typing import Any, ClassVar

from msgspec.structs import replace

from gridpeers.plant.inverters.gfm_droop import GfmDroop, advance_droop
from gridpeers.plant.inverters.inverter_model import A120, magnitude


class RegfmA1(GfmDroop, frozen=True, kw_only=True):
    """The grid-forming inverter "gridlabd" whose controller measures power and voltage of the positive sequence."""

    model: str = "regfm_a1"
    measures_positive_sequence: ClassVar[bool] = True

    @staticmethod
    def advance(g: Any, t: Any, x0: Any, x: Any, d: Any, h: float, second: bool) -> None:
        V_1 = (t.V_A + A120 * t.V_B + A120.conjugate() * t.V_C) / 3.0
        I_1 = (t.I_A + A120 * t.I_B + A120.conjugate() * t.I_C) / 3.0
        S = 3.0 * V_1 * I_1.conjugate() / g.S_b
        advance_droop(g, t, x0, x, d, S.real, S.imag, magnitude(V_1) / g.V_b, h, second)


REGFM_A1 = RegfmA1(
    R_f=0.0,
    X_f=0.15,
    P_max=0.9,
    k_pp=0.01 * 2.0 * pi * 60.0,
    k_ip=0.1 * 2.0 * pi * 60.0,
    Q_max=0.44,
    Q_min=-0.44,
    E_max=1.15,
)
"""Default values of public implementations of REGFM_A1 at 60 Hz, but R_f (0; GridKit: 0.03); VFlag is 1."""

REGFM_A1_VFLAG0 = replace(REGFM_A1, voltage_control=False, k_pq=0.1, k_iq=10.0)
"""The same with VFlag 0, which has other gains of the Q limiters."""
