r"""Consensus by event-based broadcasting: neighbours are told only when they would be wrong by too much. Pure.

G. S. Seyboth, D. V. Dimarogonas, K. H. Johansson, "Event-based broadcasting for multi-agent average consensus",
Automatica 49(1), 2013:

.. math::
    u_i = -\sum_j c_{ij} (\hat x_i - \hat x_j), \qquad
    \text{broadcast when } |\hat x_i - x_i| > c_0 + c_1 e^{-\alpha t}

where a hat is the value broadcast last, the own one included. Here x is m_p P_set, and a second trigger of the same
form watches m_q q. Leaders add their own frequency and voltage errors as in (13), (15) of the paper that gridpeers
began with, as their own measurements need no broadcast. Time in the trigger counts from the last `start`.

**What the paper claims.** Agents reach a ball around agreement whose radius is proportional to c_0, at most
norm(L) sqrt(N) c_0 / lambda_2, without Zeno behaviour, and with fewer messages than periodic broadcasting.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from typing import Annotated, Any

from agents.laws.consensus import Consensus
from agents.laws.law import Neighbour, Own, SetPoints
from wire.plausible import Range, Unit


class EventTriggered(Consensus):
    """The paper's consensus, with the triggering condition of Seyboth et al. in front of every broadcast."""

    source = "Seyboth, Dimarogonas, Johansson, Automatica 49(1), 2013"

    c_0: Annotated[float, Unit("pu frequency"), Range(0, 1), "Error of m_p P_set that is tolerated for good."] = 2e-5
    c_1: Annotated[float, Unit("pu frequency"), Range(0, 1), "Error tolerated besides at the start."] = 2e-4
    rate: Annotated[float, Unit("1/s"), Range(0, 1e3), "Rate alpha at which that besides fades."] = 1.0
    q_0: Annotated[float, Unit("pu voltage"), Range(0, 1), "Error of m_q q that is tolerated."] = 2e-4

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        self._told: tuple[float, float] | None = None
        self._began = 0.0

    def start(self, own: Own) -> None:
        """Begin with a broadcast."""
        self._told, self._began = None, own.t

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        """Decide on the values broadcast last, the own ones included, and whether to broadcast new ones."""
        P_hat, z_hat = self._told or (own.P_set, own.z)
        seen = super().step(own._replace(P_set=P_hat, z=z_hat), neighbours, T)
        P_set = min(max(own.P_set + (seen.P_set - P_hat), self.P_set_min), self.P_set_max)
        wrong = abs(P_hat - P_set) * own.m_p
        send = (
            self._told is None
            or wrong > self.c_0 + self.c_1 * exp(-self.rate * (own.t - self._began))
            or abs(z_hat - own.z) > self.q_0
        )
        if send:
            self._told = P_set, own.z
        return SetPoints(P_set, seen.V_set, send=send)
