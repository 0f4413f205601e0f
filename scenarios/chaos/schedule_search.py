"""Draw schedules by a seed, and shrink one that fails: hypothesis does both."""

from __future__ import annotations

from collections.abc import Callable

import hypothesis
import msgspec
from hypothesis import HealthCheck, Phase

from scenarios.chaos.disturbance import Schedule
from scenarios.chaos.disturbed_scenario import ChaosBase
from scenarios.chaos.schedule_strategy import schedules

BATCH = 25
"""Schedules that are drawn together, from a seed of their own: so that the first runs of a seed are the same however
many follow, and few are drawn again to shrink one."""

TRIES = 150
"""Most runs to shrink one failure."""


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
        Whether a schedule fails; asked once for each.
    """
    batch, place = divmod(number, BATCH)
    known: dict[bytes, bool] = {}
    simplest: Schedule = ()
    passed = 0

    def attempt(schedule: Schedule) -> None:
        nonlocal passed, simplest
        key = msgspec.json.encode(schedule)
        if not known:
            passed += 1
            if passed <= place:
                return
            known[key] = True
        if key not in known:
            known[key] = len(known) < TRIES and fails(schedule)
        if known[key]:
            simplest = schedule
            raise _FailsError

    try:
        _search(base, seed, batch, attempt, (Phase.generate, Phase.shrink))
    except _FailsError:  # of the simplest one, which hypothesis tries again at the end
        return _without_idle_ones(base, simplest, fails)
    raise AssertionError(f"run {number} of seed {seed} is not drawn again")


def _without_idle_ones(base: ChaosBase, schedule: Schedule, fails: Callable[[Schedule], bool]) -> Schedule:
    """Return a failing schedule without the disturbances that it fails without.

    hypothesis leaves out few numbers in a row, which a disturbance of many is not.
    """
    for disturbance in schedule:
        rest = tuple(it for it in schedule if it is not disturbance)
        if base.is_possible(rest) and fails(rest):
            return _without_idle_ones(base, rest, fails)
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
