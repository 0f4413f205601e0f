"""Check of staleness: no decision uses a neighbour's value that is older than a limit."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Annotated

from agents.agent_config import MAX_AGE
from scenarios.checks.check_verdict import NotJudgedError, Violation
from scenarios.checks.checked_case import CheckedCase
from wire.schema.plausible import Plausible, Unit


class StaleValues:
    """No decision uses a neighbour's value that is older than a limit.

    A value that the neighbour's law keeps in force, without sending it again, does not grow older.
    """

    max_age_s: Annotated[float, Unit("s"), Plausible("the greatest age of a state", 0.0, 3600.0)] = 0.0
    """Greatest age (s); 0: `max_age` of the agents, and where they have none, 0.25 s, as in wall-clock time."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the oldest value that was used of each link."""
        found = case.communication
        if not found.used:
            raise NotJudgedError("no decision used a neighbour's value")
        limits = {
            config.name: self.max_age_s or config.control.degraded_communication.max_age or MAX_AGE
            for config in found.info.agents
        }
        beyond = {
            link: oldest for link, oldest in found.oldest.items() if oldest.age > limits[link[1]] + 0.5 * found.info.T_c
        }
        place = {name: i for i, name in enumerate(found.agents)}
        order = sorted(beyond, key=lambda link: (-beyond[link].age, place[link[1]], place.get(link[0], 0)))
        for (neighbour, agent), oldest in ((link, beyond[link]) for link in order):
            yield Violation(
                text=f"age of the value of {neighbour} that was used",
                t=oldest.t,
                agent=agent,
                value=oldest.age if oldest.age < inf else None,
                unit="s",
                limit=limits[agent],
            )
