"""Checks of sharing: at the end of each event's window, the inverters of each island share power and vars equally."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated

import numpy as np

from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Since, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase, IslandWindow
from gridpeers.scenarios.results.history import Flags, Floats, History, Nameplates
from gridpeers.scenarios.results.sharing_index import NO_LOAD, sharing_index
from gridpeers.scenarios.results.steadiness import ends_of
from gridpeers.wire.schema.plausible import Plausible, Unit

_LIMIT = Plausible("a sharing index", 1e-4, 2.0, above_zero=True)
_AFTER = Plausible("a settling time", 0.0, 3600.0)


class PowerSharing(Check):
    """At the end of each window, the inverters of an island deliver equal real power per unit of their ratings."""

    limit: Annotated[float, _LIMIT] = 0.01
    """Largest MPSI, (16): what the paper calls shared."""
    after_s: Annotated[float, Unit("s"), _AFTER] = 2.0
    """Shortest time (s) from the event to the end of a window that is judged."""
    since_s: Since = 0.0
    """Run time (s) from which on it is judged: the end of the last fault of links or agents, say."""
    with_killed: bool = True
    """Whether inverters count whose agents the scenario has killed: they stay at their last set-points."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        yield from _unequal(case, self, "MPSI", lambda history: history.P, lambda of: of.m_p)


class VarSharing(Check):
    """At the end of each window, the inverters of an island deliver equal vars per unit of their ratings."""

    limit: Annotated[float, _LIMIT] = 0.2
    """Largest MQSI, (17): a fifth of what islanding leaves without coordination, as in the paper."""
    after_s: Annotated[float, Unit("s"), _AFTER] = 2.0
    """Shortest time (s) from the event to the end of a window that is judged."""
    since_s: Since = 0.0
    """Run time (s) from which on it is judged: the end of the last fault of links or agents, say."""
    with_killed: bool = True
    """Whether inverters count whose agents the scenario has killed: they stay at their last set-points."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        yield from _unequal(case, self, "MQSI", lambda history: history.Q, lambda of: of.m_q)


def _unequal(
    case: CheckedCase,
    check: PowerSharing | VarSharing,
    index: str,
    power: Callable[[History], Floats],
    droop: Callable[[Nameplates], Floats],
) -> Iterator[Violation]:
    if not case.windows:
        raise NotJudgedError("the run has no event")
    judged = 0
    for part in case.parts:
        end = ends_of(part.history.t, part.window.start, part.window.end).steady
        end = end & case.rows_from(part, check.after_s, check.since_s)
        if part.fed or not end.any():
            continue
        sharing = _sharing(case, part, with_killed=check.with_killed)[end]
        x, s, m = power(part.history)[end], part.nameplates.s, droop(part.nameplates)
        if not _anything_shared(x, s, sharing):
            continue
        judged += 1
        found = float(np.nanmean(sharing_index(x, s, m, sharing)))
        if found > check.limit:
            yield _violation(part, x, s, m, sharing, found, check.limit, index)
    if not judged:
        raise NotJudgedError(f"no island of two inverters shares anything {check.after_s:g} s after an event")


def _sharing(case: CheckedCase, part: IslandWindow, *, with_killed: bool) -> Flags:
    """Return which inverters share, by row: present, with an agent, and not at the limit of their available power."""
    present: Flags = part.history.present & part.nameplates.shares & ~case.at_limit(part)
    return present if with_killed else present & ~case.killed(part.history)


def _anything_shared(x: Floats, s: Floats, sharing: Flags) -> bool:
    """Whether at least two inverters share a power that is more than noise, in every row."""
    if not (sharing.sum(axis=1) >= 2).all():
        return False
    total = np.abs(np.where(sharing, x, 0.0).sum(axis=1))
    return bool((total / np.where(sharing, s, 0.0).sum(axis=1)).mean() >= NO_LOAD)


def _violation(
    part: IslandWindow, x: Floats, s: Floats, m: Floats, sharing: Flags, found: float, limit: float, index: str
) -> Violation:
    """Return the violation of an island, with the inverter that is farthest from its equal share."""
    equal = np.where(sharing, x, 0.0).sum() / np.where(sharing, s / m, 0.0).sum()
    far = int(np.abs(np.where(sharing, m * x / s - equal, 0.0)).sum(axis=0).argmax())
    return Violation(
        text=f"{index}, {part.label}",
        t=part.window.end,
        agent=part.history.inverters[far],
        value=found,
        limit=limit,
    )
