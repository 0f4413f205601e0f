r"""Distributed averaging proportional-integral control (DAPI) of frequency and voltage. Pure.

J. W. Simpson-Porco, Q. Shafiee, F. Dörfler, J. C. Vasquez, J. M. Guerrero, F. Bullo, "Secondary Frequency and Voltage
Control of Islanded Microgrids via Distributed Averaging", IEEE Trans. Ind. Electron. 62(11), 2015. Its frequency part
is from Simpson-Porco, Dörfler, Bullo, "Synchronization and power sharing for droop-controlled inverters in islanded
microgrids", Automatica 49(9), 2013.

.. math::
    k_i \dot \Omega_i &= -(\omega_i - \omega^*) - \sum_j a_{ij} (\Omega_i - \Omega_j) \\
    \kappa_i \dot e_i &= -\beta_i (E_i - E^*) - \sum_j b_{ij} (Q_i/Q_i^* - Q_j/Q_j^*)

with the droops :math:`\omega_i = \omega^* - m_i P_i + \Omega_i` and :math:`E_i = E^* - n_i Q_i + e_i`. Here per unit:
Omega = m_p P_set, e = V_set - 1, Q/Q* = m_q q; E is the measured terminal voltage. Every inverter integrates its own
frequency error, leaders and followers alike. In discrete time each sum is one explicit Euler step with all old values,
limited to half of the way to the neighbours, which go the other half.

**Claims of the papers.** For any connected graph and any gains the frequency returns to nominal and power is shared in
proportion to the droops (2013). With beta = 0 vars are shared exactly, with b = 0 voltages are regulated exactly; in
between lies a compromise (2015).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.schema.table_schema import Range, Unit


class Dapi(Law):
    """Distributed averaging PI control: every inverter integrates its own error, and averages with its neighbours."""

    source = "Simpson-Porco et al., IEEE Trans. Ind. Electron. 62(11), 2015"

    k: Annotated[float, Unit("s"), Range(1e-3, 1e3), "Time constant of the frequency integral."] = 0.2
    a: Annotated[float, Range(0, 1e3), "Weight of each neighbour in the average of m_p P_set."] = 1.0
    kappa: Annotated[float, Unit("s"), Range(1e-3, 1e3), "Time constant of the voltage integral."] = 0.5
    beta: Annotated[float, Range(0, 1e3), "Weight of the own voltage error; 0 shares vars exactly."] = 0.5
    b: Annotated[float, Range(0, 1e3), "Weight of each neighbour's vars; 0 regulates voltage exactly."] = 1.0

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        omega, weight = own.m_p * own.P_set, sum(other.weight for other in neighbours)
        apart = sum(other.weight * (omega - other.m_p * other.P_set) for other in neighbours)
        unequal = sum(other.weight * (own.z - other.m_q * other.Q) for other in neighbours)
        omega -= T / self.k * own.e + _step(T * self.a / self.k, weight) * apart
        e = own.V_set - 1.0
        e -= T * self.beta / self.kappa * (own.V - 1.0) + _step(T * self.b / self.kappa, weight) * unequal
        return SetPoints(omega / own.m_p, 1.0 + e)

    def terms(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> Terms:
        omega, weight = own.m_p * own.P_set, sum(other.weight for other in neighbours)
        P, V = _step(T * self.a / self.k, weight) / own.m_p, _step(T * self.b / self.kappa, weight)
        return Terms(
            (
                *(Term("averaging", -P * n.weight * (omega - n.m_p * n.P_set), n.name) for n in neighbours),
                Term("frequency error", -T / self.k * own.e / own.m_p),
            ),
            (
                *(Term("var sharing", -V * n.weight * (own.z - n.m_q * n.Q), n.name) for n in neighbours),
                Term("voltage error", -T * self.beta / self.kappa * (own.V - 1.0)),
            ),
        )


def _step(gain: float, weight: float) -> float:
    """Return an Euler step for a sum over neighbours, limited to half of the way to their mean."""
    return min(gain, 0.5 / weight) if weight > 0.0 else 0.0
