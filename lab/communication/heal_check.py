"""Check of heals: agents that a cut parted use each other's values again soon after its end."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Annotated

from gridpeers.lab.communication.heals import Heal
from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.wire.schema.plausible import Plausible, Unit


class Rejoined(Check):
    """Some time after the end of each cut, the receiver uses what the sender has sent since: no split is for ever."""

    within_s: Annotated[float, Unit("s"), Plausible("a time to rejoin", 0.0, 3600.0, above_zero=True)] = 6.0
    """Longest time (s): what Zenoh needs at most to find again a peer that it has lost."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the links that stay silent though sender and receiver go on."""
        found = case.communication
        if not found.heals:
            raise NotJudgedError("no link was cut and healed")
        judged = 0
        for agent in found.agents:
            for heal in found.heals:
                if heal.link[1] != agent:
                    continue
                took = self._took(heal)
                judged += took is not None
                if took is not None and took > self.within_s:
                    yield Violation(
                        text=f"no new value of {heal.link[0]} is used after the cut ended at {heal.t:g} s",
                        t=heal.t + self.within_s,
                        agent=agent,
                        value=None if took == inf else took,
                        unit="s",
                        limit=self.within_s,
                    )
        if not judged:
            raise NotJudgedError(
                f"after no cut was its link whole, and both of its agents at work, for {self.within_s:g} s"
            )

    def _took(self, heal: Heal) -> float | None:
        """Return after what time (s) a new value was used, infinity if never; None if that cannot be told.

        It cannot if they were never both at work, with a whole link, for the limit's time.
        """
        if heal.took is not None:
            return heal.took
        return inf if heal.waited > self.within_s else None
