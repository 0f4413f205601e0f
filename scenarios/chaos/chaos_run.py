"""One run of a campaign, in whatever process: from its number to its verdict. Nothing that a run can do ends it."""

from __future__ import annotations

import gc
import tempfile
from pathlib import Path
from time import monotonic

import msgspec

from scenarios.chaos.disturbance import Schedule
from scenarios.chaos.disturbed_scenario import ChaosBase, base_of
from scenarios.chaos.schedule_search import shrunk
from scenarios.checks.check_verdict import CheckVerdict
from scenarios.results.event_windows import CaseRecord
from scenarios.results.record import Recorded
from scenarios.run import BrokenRunError, Driver, Request, run_case, verdicts_on
from scenarios.schema.scenario_model import ScenarioModel
from scenarios.sweep.sweep_case import plant_at_start

ENDS, ERROR, LAWS, LINKS, REPEATS, SAME_IN_PROCESSES = (
    "ends",
    "no_error",
    "laws",
    "links",
    "repeats",
    "same_in_processes",
)
"""What is asked of every run beside the checks: it reaches its end; no error of the program; no law fails; accounts of
links balance; it repeats to the byte; processes give the bytes of one process."""

ASKED = (ENDS, ERROR, LAWS, LINKS, REPEATS, SAME_IN_PROCESSES)
"""All of them."""

COLLECTED = 10
"""Runs after which a worker looks for garbage: each leaves some ten MB in cycles."""

SEEDS = 1_000_000
"""Seeds of the messages' fates for each seed of a campaign: run n has one of its own."""


class ChaosRow(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one run."""

    number: int
    """Its number, from 0."""
    schedule: Schedule
    """What was done to it."""
    passed: tuple[str, ...] = ()
    """Checks, and what else is asked, that it passed."""
    violated: dict[str, str] = {}
    """Those that it violated, with the sentence of each."""
    history_sha256: str = ""
    """Of the bytes of its history.csv; empty if it broke."""
    links_sha256: str = ""
    """Of all verdicts of its emulated links."""
    trips: int = 0
    """Number of events in which inverters tripped."""
    took_s: float = 0.0
    """Wall-clock time (s)."""


def seed_of(seed: int, number: int) -> int:
    """Return the seed of the scenario of a run.

    Examples
    --------
    >>> seed_of(1, 12)
    1000012
    """
    return seed * SEEDS + number


def run_number(text: str, seed: int, number: int, schedule: Schedule, driver: Driver) -> ChaosRow:
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
        With processes, it runs in one process too, and both must give the same bytes.
    """
    return run_schedule(base_of(text), schedule, seed_of(seed, number), number, driver)


def shrink_number(text: str, seed: int, number: int, violated: str, driver: Driver) -> Schedule:
    """Return the simplest schedule found that violates what a run violates.

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
    """
    base = base_of(text)

    def fails(schedule: Schedule) -> bool:
        row = run_schedule(base, schedule, seed_of(seed, number), number, driver, again=violated == REPEATS)
        return violated in row.violated

    return shrunk(base, seed, number, fails)


def run_schedule(
    base: ChaosBase,
    schedule: Schedule,
    seed: int,
    number: int = 0,
    driver: Driver = "inprocess",
    *,
    again: bool = False,
) -> ChaosRow:
    """Run a scenario with a schedule, and judge it.

    Parameters
    ----------
    base : ChaosBase
        The scenario.
    schedule : Schedule
        The disturbances.
    seed : int
        Seed of the scenario.
    number : int, optional
        Number of the run.
    driver : {"inprocess", "processes"}
        See `run_number`.
    again : bool, optional
        Whether to run it twice: both must give the same bytes.
    """
    if number % COLLECTED == 0:
        gc.collect()
    began = monotonic()
    scenario = base.disturbed(schedule, seed)
    row = _judged(base, scenario, number, schedule, driver)
    if driver == "processes":
        row = compared(row, _judged(base, scenario, number, schedule, "inprocess"), SAME_IN_PROCESSES)
    if again:
        row = compared(row, _judged(base, scenario, number, schedule, driver), REPEATS)
    return msgspec.structs.replace(row, took_s=round(monotonic() - began, 3))


def compared(row: ChaosRow, other: ChaosRow, asked: str) -> ChaosRow:
    """Return the result of a run that another one must equal to the byte."""
    apart = [
        f"{name} {str(mine)[:12]} and {str(its)[:12]}"
        for name, mine, its in (
            ("history", row.history_sha256, other.history_sha256),
            ("links", row.links_sha256, other.links_sha256),
            ("verdict", sorted(row.violated.items()), sorted(other.violated.items())),
        )
        if mine != its
    ]
    if apart:
        return msgspec.structs.replace(row, violated=row.violated | {asked: f"differ: {', '.join(apart)}"})
    return msgspec.structs.replace(row, passed=(*row.passed, asked))


def run_scenario(base: ChaosBase, driver: Driver = "inprocess") -> ChaosRow:
    """Run the scenario of a base as it stands, and judge it by its own checks."""
    return _judged(base, base.scenario, 0, (), driver)


def _judged(base: ChaosBase, scenario: ScenarioModel, number: int, schedule: Schedule, driver: Driver) -> ChaosRow:
    """Run a scenario once in a temporary folder."""
    row = ChaosRow(number=number, schedule=schedule)
    with tempfile.TemporaryDirectory(prefix="gridpeers-chaos-") as folder:
        request = Request(scenario=scenario, feeder=base.feeder, driver=driver, folder=Path(folder), lasting=False)
        at_start = plant_at_start if scenario.plant.simulator == "gridpeers" and driver == "inprocess" else None
        try:
            recorded, _ = run_case(request, base.case, "", _ignore, at_start)
            record = CaseRecord.of(scenario, base.feeder, base.case, recorded)
            verdicts = verdicts_on(request, base.case, record, recorded.events)
        except BrokenRunError as error:
            return msgspec.structs.replace(row, violated={ENDS: str(error)})
        except Exception as error:
            return msgspec.structs.replace(row, violated={ERROR: f"{type(error).__name__}: {error}"})
        return _with_verdicts(row, recorded, verdicts)


def _with_verdicts(row: ChaosRow, recorded: Recorded, verdicts: tuple[CheckVerdict, ...]) -> ChaosRow:
    """Return the result with the verdicts of the checks, and with what else is asked."""
    laws = [event.text for event in recorded.events if event.kind == "law"]
    links = [*recorded.links.warnings, *sorted(recorded.links.failures)]
    unlike = "" if recorded.reproducible else "something happened that the scenario does not say"
    asked = {ENDS: "", ERROR: unlike, LAWS: "; ".join(laws[:2]), LINKS: "; ".join(links[:2])}
    violated = {name: text for name, text in asked.items() if text}
    violated |= {it.check: it.sentence for it in verdicts if it.status == "failed"}
    passed = (
        *(name for name, text in asked.items() if not text),
        *(it.check for it in verdicts if it.status == "passed"),
    )
    return msgspec.structs.replace(
        row,
        passed=passed,
        violated=violated,
        history_sha256=recorded.sha256,
        links_sha256=recorded.links.sha256,
        trips=sum(event.kind == "trip" for event in recorded.events),
    )


def _ignore(case: str, t: float, end: float) -> None:
    """Take no notice of the progress of one run."""
