"""Check of staleness: no decision uses a neighbour's value that is older than a limit."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Annotated

from gridpeers.agents.agent_config import MAX_AGE
from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Since, Violation, require_time
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.wire.schema.plausible import Plausible, Unit


class StaleValues(Check):
    """No decision uses a neighbour's value that is older than a limit.

    A value that the neighbour's law keeps in force, without sending it again, does not grow older.
    """

    max_age_s: Annotated[float, Unit("s"), Plausible("the greatest age of a state", 0.0, 3600.0)] = 0.0
    """Greatest age (s); 0: `max_age` of the agents, and where they have none, 0.25 s, as in wall-clock time."""
    since_s: Since = 0.0
    """Run time (s) from which on it is judged: the end of the last fault of links or agents, say."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the oldest value that was used of each link."""
        found = case.communication
        if not found.used:
            raise NotJudgedError("no decision used a neighbour's value")
        require_time(case.history, self.since_s)
        limits = {
            config.name: self.max_age_s or config.control.degraded_communication.max_age or MAX_AGE
            for config in found.info.agents
        }
        judged = {
            link: next((use for use in uses if use.last >= self.since_s), None) for link, uses in found.oldest.items()
        }
        beyond = {
            link: use
            for link, use in judged.items()
            if use is not None and use.age > limits[link[1]] + 0.5 * found.info.T_c
        }
        place = {name: i for i, name in enumerate(found.agents)}
        order = sorted(beyond, key=lambda link: (-beyond[link].age, place[link[1]], place.get(link[0], 0)))
        for (neighbour, agent), use in ((link, beyond[link]) for link in order):
            yield Violation(
                text=f"age of the value of {neighbour} that was used",
                t=max(use.t, self.since_s),
                agent=agent,
                value=use.age if use.age < inf else None,
                unit="s",
                limit=limits[agent],
            )
