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
from functools import partial
from typing import Annotated

from gridpeers.agents.laws.law import NOTHING_SHARED, Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.plain_sum import plain_sum
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
        omega, z, weight = own.m_p * own.P_set, own.z, plain_sum(other.weight for other in neighbours)
        apart = [other.weight * (omega - other.m_p * other.P_set) for other in neighbours]
        unequal = [other.weight * (z - other.m_q * other.Q) for other in neighbours]
        averaging, sharing = _step(T * self.a / self.k, weight), _step(T * self.b / self.kappa, weight)
        f_error, V_error = T / self.k * own.e, T * self.beta / self.kappa * (own.V - 1.0)
        omega -= f_error + averaging * plain_sum(apart)
        e = own.V_set - 1.0 - (V_error + sharing * plain_sum(unequal))
        of_P, of_V = (averaging / own.m_p, apart, f_error / own.m_p), (sharing, unequal, V_error)
        return SetPoints(omega / own.m_p, 1.0 + e, NOTHING_SHARED, True, partial(_terms, neighbours, of_P, of_V))


_Sums = tuple[float, list[float], float]  # Step of a sum over neighbours, its summands, and the own error


def _terms(neighbours: Sequence[Neighbour], of_P: _Sums, of_V: _Sums) -> Terms:
    (step_P, apart, f_error), (step_V, unequal, V_error) = of_P, of_V
    P = [Term("averaging", -step_P * d, n.name) for d, n in zip(apart, neighbours, strict=True)]
    V = [Term("var sharing", -step_V * d, n.name) for d, n in zip(unequal, neighbours, strict=True)]
    return Terms((*P, Term("frequency error", -f_error)), (*V, Term("voltage error", -V_error)))


def _step(gain: float, weight: float) -> float:
    return min(gain, 0.5 / weight) if weight > 0.0 else 0.0  # at most half of the way to their mean
