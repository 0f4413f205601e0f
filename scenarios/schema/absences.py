"""When an agent of a scenario is away: a lie or another fault that is planned for that time does not happen."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from math import inf
from typing import NamedTuple


class AgentEvent(NamedTuple):
    """An event at which agents leave and join."""

    t_s: float
    """Run time (s)."""
    leave: Collection[str]
    join: Collection[str]


def why_away(name: str, begin_s: float, end_s: float, events: Iterable[AgentEvent], *, at_start: bool) -> str:
    """Return why an agent is away all the time between two run times, "" if it is there at any.

    Kills need not be asked for: an agent that is killed has no other fault of its own from then on.

    Parameters
    ----------
    name : str
        The agent.
    begin_s, end_s : float
        Run times (s); the end may be infinite.
    events : Iterable[AgentEvent]
        The scenario's events, in the order of time.
    at_start : bool
        Whether the agent is there at t = 0.

    Examples
    --------
    >>> events = [AgentEvent(2.0, ["inv2"], []), AgentEvent(3.0, [], ["inv2"])]
    >>> why_away("inv2", 2.0, 3.0, events, at_start=True), why_away("inv2", 2.0, 3.5, events, at_start=True)
    ('has left at 2 s', '')
    """
    for begin, end, why in _absences(name, events, at_start=at_start):
        if begin <= begin_s and end_s <= end:
            return why
    return ""


def _absences(name: str, events: Iterable[AgentEvent], *, at_start: bool) -> Iterator[tuple[float, float, str]]:
    """Yield the run times (s) between which an agent has not joined yet, or has left, and why."""
    away, why = (inf, "") if at_start else (0.0, "has not joined")
    for event in events:
        if name in event.leave:
            away, why = event.t_s, f"has left at {event.t_s:g} s"
        elif name in event.join and away < inf:
            yield away, event.t_s, why
            away = inf
    if away < inf:
        yield away, inf, why
