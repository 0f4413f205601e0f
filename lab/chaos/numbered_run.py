"""One run of a campaign in whatever process, by its number: it is run, or shrunk if it fails."""

from __future__ import annotations

from pathlib import Path

import msgspec

from gridpeers.lab.chaos.chaos_run import REPEATS, ChaosRow, run_schedule
from gridpeers.lab.chaos.disturbance import Schedule
from gridpeers.lab.chaos.disturbed_scenario import base_of
from gridpeers.lab.chaos.machine_error import MachineError
from gridpeers.lab.chaos.schedule_search import shrunk
from gridpeers.scenarios.run_request import Driver

SEEDS = 1_000_000
"""Seeds of the messages' fates for each seed of a campaign: run n has one of its own."""


def seed_of(seed: int, number: int) -> int:
    """Return the seed of the scenario of a run.

    Examples
    --------
    >>> seed_of(1, 12)
    1000012
    """
    return seed * SEEDS + number


def run_number(
    text: str, seed: int, number: int, schedule: Schedule, driver: Driver, within: Path | None = None
) -> ChaosRow:
    """Run a campaign's run with a number.

    Parameters
    ----------
    text : str
        The base (`ChaosBase.text`).
    seed : int
        Seed of the campaign.
    number : int
        Number of the run.
    schedule : Schedule
        What was drawn for it.
    driver : {"inprocess", "processes"}
        See `run_schedule`.
    within : Path, optional
        See `run_schedule`.

    Raises
    ------
    MachineError
        If the machine lacks what the run needs.
    """
    return run_schedule(base_of(text), schedule, seed_of(seed, number), number, driver, within=within)


def shrink_number(
    text: str, seed: int, number: int, violated: str, driver: Driver, within: Path | None = None
) -> ChaosRow:
    """Return the run of the simplest schedule found that violates what a run violates.

    Parameters
    ----------
    text : str
        The base (`ChaosBase.text`).
    seed, number : int
        Of the campaign, and of the run.
    violated : str
        Name of the check, or of what else is asked.
    driver : {"inprocess", "processes"}
        As for `run_number`.
    within : Path, optional
        As for `run_number`.

    Raises
    ------
    MachineError
        If the machine lacks what a run needs.
    """
    base = base_of(text)
    rows: dict[bytes, ChaosRow] = {}

    def row_of(schedule: Schedule) -> ChaosRow:
        again = violated == REPEATS
        row = run_schedule(base, schedule, seed_of(seed, number), number, driver, again=again, within=within)
        return rows.setdefault(msgspec.json.encode(schedule), row)

    def fails(schedule: Schedule) -> bool:
        try:
            return violated in row_of(schedule).violated
        except MachineError as error:
            raise _SearchEnd(error) from error

    try:
        simplest = shrunk(base, seed, number, fails)
    except _SearchEnd as end:
        raise end.why from None
    return rows.get(msgspec.json.encode(simplest)) or row_of(simplest)  # that of the run itself is not run to shrink it


class _SearchEnd(BaseException):
    """Ends a search at once: hypothesis would take an `Exception` for a failure, and shrink it."""

    def __init__(self, why: MachineError) -> None:
        super().__init__(str(why))
        self.why = why
