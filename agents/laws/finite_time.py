r"""Finite-time consensus and restoration: differences below one count by a power less than one. Pure.

L. Wang, F. Xiao, "Finite-Time Consensus Problems for Networks of Dynamic Agents", IEEE Trans. Autom. Control 55(4),
2010; in microgrids: S. Zuo, A. Davoudi, Y. Song, F. L. Lewis, "Distributed Finite-Time Voltage and
Frequency Restoration in Islanded AC Microgrids", IEEE Trans. Ind. Electron. 63(10), 2016.

.. math::
    \dot x_i = c \sum_j a_{ij} \operatorname{sig}(x_j - x_i)^{\gamma} + c\, g_i \operatorname{sig}(x^* - x_i)^{\gamma},
    \qquad \operatorname{sig}(u)^\gamma = \operatorname{sign}(u) |u|^\gamma, \quad 0 < \gamma < 1

For frequency x is m_p P_set, and a leader's reference term is its own frequency error; for voltage the consensus is on
m_q q and the reference is nominal voltage. Near zero the gain of sig grows without bound, so an explicit step would
chatter there: no term moves further than half of its own difference (the neighbour moves the other half), and a
leader's term for frequency no further than the whole of it.

**Claim of the paper.** Over a connected undirected graph agents agree in finite time; asymptotic laws never do.
With V = 1/2 sum_i (x_i - mean)^2 and unit weights, V' = -c/2 sum_ij |x_j - x_i|^{1+gamma} is at most
-c/2 (4 lambda_2 V)^{(1+gamma)/2}, so they agree at the latest after

.. math:: T^* = \frac{4 V_0^{(1-\gamma)/2}}{c (1-\gamma) (4 \lambda_2)^{(1+\gamma)/2}} .
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import copysign
from typing import Annotated

from gridpeers.agents.laws.law import NOTHING_SHARED, Law, Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.plain_sum import plain_sum
from gridpeers.wire.schema.table_schema import Range, Unit


class FiniteTime(Law):
    """Consensus by differences to a power below one (Wang and Xiao), with leaders that restore nominal values."""

    source = "Wang, Xiao, IEEE Trans. Autom. Control 55(4), 2010; Zuo et al., IEEE Trans. Ind. Electron. 63(10), 2016"

    gamma: Annotated[float, Range(0.05, 0.999), "Power of a difference."] = 0.5
    c_P: Annotated[float, Unit("pu^(1-gamma)/s"), Range(0, 1e4), "Gain of m_p P_set."] = 0.4
    c_V: Annotated[float, Unit("pu^(1-gamma)/s"), Range(0, 1e4), "Gain of V_set."] = 0.4
    alpha: Annotated[float, Range(0, 1e3), "Weight of a leader's voltage error beside that of one neighbour."] = 1.0

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        y, most = own.m_p * own.P_set, 0.5 / max(1, len(neighbours))
        P = [n.weight * self._move(n.m_p * n.P_set - y, T * self.c_P, most) for n in neighbours]
        V = [n.weight * self._move(n.m_q * n.Q - own.z, T * self.c_V, most) for n in neighbours]
        f_error = self._move(-own.e, T * self.c_P, 1.0) if own.leader else 0.0
        V_error = self._move(1.0 - own.V, T * self.c_V * self.alpha, 0.5) if own.leader else 0.0

        P_set, V_set = (y + (plain_sum(P) + f_error)) / own.m_p, own.V_set + (plain_sum(V) + V_error)
        return SetPoints(P_set, V_set, NOTHING_SHARED, True, partial(_terms, own, neighbours, P, V, (f_error, V_error)))

    def _move(self, difference: float, gain: float, most: float) -> float:
        size = abs(difference)
        return copysign(min(gain * size**self.gamma, most * size), difference)


def _terms(
    own: Own, neighbours: Sequence[Neighbour], P: list[float], V: list[float], errors: tuple[float, float]
) -> Terms:
    of_P = [Term("consensus", move / own.m_p, n.name) for move, n in zip(P, neighbours, strict=True)]
    of_V = [Term("var sharing", move, n.name) for move, n in zip(V, neighbours, strict=True)]
    if own.leader:
        of_P.append(Term("frequency error", errors[0] / own.m_p))
        of_V.append(Term("voltage error", errors[1]))
    return Terms(of_P, of_V)
