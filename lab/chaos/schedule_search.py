"""Draw schedules by a seed, and shrink one that fails: hypothesis does both."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import hypothesis
import msgspec
from hypothesis import HealthCheck, Phase

from gridpeers.lab.chaos.disturbance import Schedule
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase
from gridpeers.lab.chaos.schedule_strategy import schedules

BATCH = 25
"""Schedules that are drawn together, from a seed of their own: so that the first runs of a seed are the same however
many follow, and few are drawn again to shrink one."""

TRIES = 150
"""Most runs to shrink one failure, in all."""

IDLE_PART = 5
"""A fifth of these runs is kept for leaving out disturbances one by one, once hypothesis is done."""


class _FailsError(Exception):
    """A schedule fails."""


def drawn(base: ChaosBase, seed: int, batch: int) -> list[Schedule]:
    """Return the schedules of a batch.

    Parameters
    ----------
    base : ChaosBase
        The scenario.
    seed : int
        The same one gives the same schedules, with the same version of hypothesis.
    batch : int
        Number of the batch, from 0.
    """
    found: list[Schedule] = []
    _search(base, seed, batch, found.append, (Phase.generate,))
    return found + [()] * (BATCH - len(found))  # there are fewer where hardly anything is possible


def shrunk(base: ChaosBase, seed: int, number: int, fails: Callable[[Schedule], bool]) -> Schedule:
    """Return the simplest schedule found that fails, begun with that of a run: few disturbances, short and early.

    Parameters
    ----------
    base : ChaosBase
        The scenario.
    seed : int
        Of the runs.
    number : int
        Number of the run, whose schedule fails.
    fails : Callable[[Schedule], bool]
        Whether a schedule fails; asked once for each, and `TRIES` times at most.

    Returns
    -------
    Schedule
        Empty for a run beyond those that hypothesis draws: it had no disturbances.
    """
    batch, place = divmod(number, BATCH)
    asked = _Asked(fails)
    simplest: Schedule = ()
    passed = 0

    def attempt(schedule: Schedule) -> None:
        nonlocal passed, simplest
        if passed <= place:
            passed += 1
            if passed <= place:
                return
            asked.note_failure(schedule)
        if asked.fails(schedule, TRIES - TRIES // IDLE_PART):
            simplest = schedule
            raise _FailsError

    with suppress(_FailsError):  # of the simplest one, which hypothesis tries again at the end
        _search(base, seed, batch, attempt, (Phase.generate, Phase.shrink))
    return _without_idle_ones(base, simplest, asked)


class _Asked:
    """Whether schedules fail: each is run once, and all together no more often than they may.

    Parameters
    ----------
    fails : Callable[[Schedule], bool]
        Runs a schedule.
    """

    def __init__(self, fails: Callable[[Schedule], bool]) -> None:
        self._fails = fails
        self._known: dict[bytes, bool] = {}
        self._runs = 0

    def note_failure(self, schedule: Schedule) -> None:
        """Note a schedule that is known to fail."""
        self._known[msgspec.json.encode(schedule)] = True

    def fails(self, schedule: Schedule, most: int) -> bool:
        """Return whether a schedule is known to fail, after a run of it unless there were `most` runs already."""
        key = msgspec.json.encode(schedule)
        if key not in self._known and self._runs < most:
            self._runs += 1
            self._known[key] = self._fails(schedule)
        return self._known.get(key, False)


def _without_idle_ones(base: ChaosBase, schedule: Schedule, asked: _Asked) -> Schedule:
    """Return a failing schedule without the disturbances that it fails without.

    hypothesis leaves out few numbers in a row, which a disturbance of many is not.
    """
    for disturbance in schedule:
        rest = tuple(it for it in schedule if it is not disturbance)
        if base.is_possible(rest) and asked.fails(rest, TRIES):
            return _without_idle_ones(base, rest, asked)
    return schedule


def _search(
    base: ChaosBase, seed: int, batch: int, attempt: Callable[[Schedule], None], phases: tuple[Phase, ...]
) -> None:
    """Have hypothesis draw the schedules of a batch; a seed of a batch is no other batch's."""
    given = hypothesis.given(schedules(base))(lambda schedule: attempt(schedule))
    settings = hypothesis.settings(
        max_examples=BATCH,
        phases=phases,
        database=None,
        deadline=None,
        derandomize=False,
        report_multiple_bugs=False,
        print_blob=False,
        suppress_health_check=list(HealthCheck),
        verbosity=hypothesis.Verbosity.quiet,
    )
    hypothesis.seed(seed * 1_000_003 + batch)(settings(given))()
