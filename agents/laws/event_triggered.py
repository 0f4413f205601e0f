r"""Consensus by event-based broadcasting: an agent sends only when its last broadcast is wrong by too much. Pure.

G. S. Seyboth, D. V. Dimarogonas, K. H. Johansson, "Event-based broadcasting for multi-agent average consensus",
Automatica 49(1), 2013:

.. math::
    u_i = -\sum_j c_{ij} (\hat x_i - \hat x_j), \qquad
    \text{broadcast when } |\hat x_i - x_i| > c_0 + c_1 e^{-\alpha t}

where a hat marks the last broadcast value, the own one included. Here x is m_p P_set, and a second trigger of the same
form watches m_q q. Leaders add their own frequency and voltage errors as in (13), (15) of Singhal et al. 2022, because
their own measurements need no broadcast. Time in the trigger counts from the last `start`.

**Claim of the paper.** Agents reach a ball around agreement whose radius is proportional to c_0, at most
norm(L) sqrt(N) c_0 / lambda_2, without Zeno behaviour, and with fewer messages than periodic broadcasting.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from typing import Annotated, Any

from gridpeers.agents.laws.consensus import Consensus
from gridpeers.agents.laws.law import Neighbour, Own, SetPoints, Term, Terms
from gridpeers.wire.schema.table_schema import Range, Unit


class EventTriggered(Consensus):
    """The paper's consensus with event-based broadcasting: an agent sends after a sufficient change."""

    source = "Seyboth, Dimarogonas, Johansson, Automatica 49(1), 2013"

    c_0: Annotated[float, Unit("pu frequency"), Range(0, 1), "Permanent tolerance of m_p P_set."] = 2e-5
    c_1: Annotated[float, Unit("pu frequency"), Range(0, 1), "Additional tolerance at the start."] = 2e-4
    rate: Annotated[float, Unit("1/s"), Range(0, 1e3), "Rate alpha at which the additional tolerance decays."] = 1.0
    q_0: Annotated[float, Unit("pu voltage"), Range(0, 1), "Tolerance of m_q q."] = 2e-4

    def __init__(self, **parameters: Any) -> None:
        super().__init__(**parameters)
        self._last_broadcast: tuple[float, float] | None = None
        """Last broadcast P_set and m_q q (pu)."""
        self._started_at = 0.0

    def start(self, own: Own) -> None:
        self._last_broadcast, self._started_at = None, own.t

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        """Decide from the last broadcast values, the own ones included, and whether to broadcast new ones."""
        P_hat, z_hat = self._last_broadcast or (own.P_set, own.z)
        seen = super().step(own._replace(P_set=P_hat, z=z_hat), neighbours, T)
        P_seen = min(max(seen.P_set, self.P_set_min), self.P_set_max)
        P_set = min(max(own.P_set + (P_seen - P_hat), self.P_set_min), self.P_set_max)
        wrong = abs(P_hat - P_set) * own.m_p
        send = (
            self._last_broadcast is None
            or wrong > self.c_0 + self.c_1 * exp(-self.rate * (own.t - self._started_at))
            or abs(z_hat - own.z) > self.q_0
        )
        if send:
            self._last_broadcast = P_set, own.z
        return SetPoints(P_set, seen.V_set, send=send, terms=lambda: self._terms_of(seen, P_seen - seen.P_set))

    @staticmethod
    def _terms_of(seen: SetPoints, beyond: float) -> Terms:
        assert seen.terms is not None
        P, V, *_ = seen.terms()
        return Terms((*P, Term("limit of the last broadcast", beyond)) if beyond else P, V)
