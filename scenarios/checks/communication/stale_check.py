"""Check of staleness: no decision uses a neighbour's value that is older than a limit."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Annotated

from agents.agent_config import MAX_AGE
from scenarios.checks.check_verdict import NotJudgedError, Violation
from scenarios.checks.checked_case import CheckedCase
from scenarios.checks.communication.record_content import Link, RecordContent
from scenarios.checks.communication.used_states import UsedState, used_states
from wire.schema.plausible import Plausible, Unit


class StaleValues:
    """No decision uses a neighbour's value that is older than a limit.

    A value that the neighbour's law keeps in force, without sending it again, does not grow older.
    """

    max_age_s: Annotated[float, Unit("s"), Plausible("the greatest age of a state", 0.0, 3600.0)] = 0.0
    """Greatest age (s); 0: `max_age` of the agents, and where they have none, 0.25 s, as in wall-clock time."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield the oldest value that was used of each link."""
        content, used = case.content, 0
        kept = _kept(content)
        worst: dict[Link, tuple[float, UsedState, float]] = {}
        for config in content.info.agents:
            own = config.control.degraded_communication.max_age or MAX_AGE
            limit = self.max_age_s or own
            for each in used_states(content, config.name):
                if each.unused:
                    continue
                used += 1
                age = float("inf") if each.age is None else _age(each, kept, config.T_c)
                if age > limit + 0.5 * config.T_c and age > worst.get(each.link, (0.0,))[0]:
                    worst[each.link] = age, each, limit
        if not used:
            raise NotJudgedError("no decision used a neighbour's value")
        for (neighbour, agent), (age, each, limit) in sorted(worst.items(), key=lambda item: -item[1][0]):
            yield Violation(
                text=f"age of the value of {neighbour} that was used",
                t=each.t,
                agent=agent,
                value=age if age < float("inf") else None,
                unit="s",
                limit=limit,
            )


def _kept(content: RecordContent) -> dict[str, set[int]]:
    """Return the numbers of quiet states of each agent: they keep the last other one in force."""
    kept: dict[str, set[int]] = defaultdict(set)
    for agent, states in content.states.items():
        kept[agent] = {state.number for state in states.values() if state.quiet}
    return kept


def _age(each: UsedState, kept: dict[str, set[int]], T_c: float) -> float:
    """Return the age (s) of a value, counted from the last tick at which its sender kept it in force."""
    assert each.age is not None
    assert each.number is not None
    quiet, last = kept[each.link[0]], each.number
    while last + 1 in quiet:
        last += 1
    return max(0.0, each.age - (last - each.number) * T_c)
