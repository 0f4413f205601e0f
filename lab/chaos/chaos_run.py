"""One run of a campaign: from its schedule to its verdict. Nothing that a run can do ends the campaign."""

from __future__ import annotations

import errno
import re
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from time import monotonic

import msgspec

from gridpeers.lab.chaos.disturbed_scenario import WITHIN_S, ChaosBase, Schedule
from gridpeers.scenarios.checks.check_registry import LAW_FAILED
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.checks.judging import judge_case
from gridpeers.scenarios.results.recorded_events import tripped_by, tripped_inverters
from gridpeers.scenarios.results.run_files import JournalRow
from gridpeers.scenarios.run import run_case
from gridpeers.scenarios.run_request import BrokenRunError, Driver, LawStopError, Request
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.sweep.sweep_case import plant_at_start
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import utf8

ASKED = ENDS, ERROR, LINKS, REPEATS, SAME_IN_PROCESSES = "ends", "no_error", "links", "repeats", "same_in_processes"
"""Questions about every run beside the checks: it reaches its end; no error of the program; accounts of links balance;
it repeats to the byte; processes give the bytes of one process."""

LONGER_RUNS = 6
"""Most times that a run with trips is done, each longer than the one before: inverters stay off after three trips
without a minute in service between."""


class ChaosRow(JournalRow, frozen=True, kw_only=True):
    schedule: Schedule
    passed: tuple[str, ...] = ()
    violated: dict[str, str] = msgspec.field(default_factory=dict)
    unsettled: str = ""
    """Why it may be judged too early: inverters tripped and returned in each of its ever longer runs."""
    history_sha256: str = ""
    links_sha256: str = ""
    trips: int = 0
    since_s: float = 0.0
    """Run time (s) from which on it was to be restored: that of the last change, or later, as inverters tripped."""
    took_s: float = 0.0

    @property
    def status(self) -> str:
        return "violated" if self.violated else "passed"


def run_schedule(
    base: ChaosBase,
    schedule: Schedule,
    seed: int,
    number: int = 0,
    driver: Driver = "inprocess",
    *,
    again: bool = False,
    within: Path | None = None,
) -> ChaosRow:
    """Run a scenario with a schedule and a seed of its own, and judge it; MachineError if the machine is to blame.

    With processes it runs in one process too, and with `again` once more: both must give the same bytes. Temporary
    folders are made `within` that of the campaign.
    """
    began = monotonic()

    row = _settled(base, schedule, seed, number, driver, within)
    if driver == "processes":
        row = compared(row, _settled(base, schedule, seed, number, "inprocess", within), SAME_IN_PROCESSES)
    if again:
        row = compared(row, _settled(base, schedule, seed, number, driver, within), REPEATS)
    violated = {name: utf8(text) for name, text in row.violated.items()}  # an error may name a file by any bytes
    return msgspec.structs.replace(row, violated=violated, took_s=round(monotonic() - began, 3))


def compared(row: ChaosRow, other: ChaosRow, asked: str) -> ChaosRow:
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


def restored_from(events: Iterable[PlantEvent], enter_service_s: float) -> float:
    """Return the run time (s) from which on a run with trips is to be restored; 0 for one without.

    It is that of the last trip or return. While inverters are off, it is later by the time in which voltage and
    frequency are to become normal, and by that for which they must be before an inverter returns.
    """
    events = tuple(events)
    last = max((event.t for event in events if event.kind == "trip"), default=0.0)
    return round(last + (WITHIN_S + enter_service_s if tripped_inverters(events) else 0.0), 9)


def _settled(
    base: ChaosBase, schedule: Schedule, seed: int, number: int, driver: Driver, within: Path | None
) -> ChaosRow:
    """Run a scenario with a schedule; if inverters trip, again and so long that they are judged after their return."""
    since_s = base.changed_s(schedule)
    for _ in range(LONGER_RUNS):
        row = ChaosRow(number=number, schedule=schedule, since_s=since_s)
        row, restored_s = judged(base, base.disturbed(schedule, seed, since_s), row, driver, within)
        if restored_s <= since_s:
            return row
        since_s = restored_s
    text = f"after {LONGER_RUNS} runs still judged from {row.since_s:g} s on, {since_s:g} s would be right"
    return msgspec.structs.replace(row, unsettled=f"inverters trip and return: {text}")


def judged(
    base: ChaosBase, scenario: ScenarioModel, row: ChaosRow, driver: Driver, within: Path | None = None
) -> tuple[ChaosRow, float]:
    """Run a scenario and judge it; return from which run time (s) on it is to be restored, too."""
    try:
        temporary = tempfile.TemporaryDirectory(prefix="gridpeers-chaos-", dir=within, ignore_cleanup_errors=True)
    except OSError as error:
        raise MachineError(str(error)) from None
    with temporary as name:
        folder = Path(name)
        request = Request(scenario=scenario, feeder=base.feeder, driver=driver, folder=folder, lasting=False)
        at_start = plant_at_start if scenario.plant.simulator == "gridpeers" and driver == "inprocess" else None
        try:
            recorded, outcome = run_case(request, base.case, "", lambda case, t, end: None, at_start)
            case = CheckedCase.of(scenario, base.feeder, base.case, recorded, folder / base.case)
            verdicts = judge_case(case)
            told = [event.text for event in recorded.events if event.kind == "law"]
            told += [*outcome.notes, *(it.reason for it in verdicts if it.status == "failed")]
            if lack := machine_error(*told):  # an agent may die, a law or a check fail, and the run goes on
                raise lack
        except MachineError:
            raise
        except Exception as error:
            if lack := machine_error(error):
                raise lack from error
            violated = {ERROR: f"{type(error).__name__}: {error}"}
            if isinstance(error, BrokenRunError):
                violated = {LAW_FAILED if isinstance(error, LawStopError) else ENDS: str(error)}
            return msgspec.structs.replace(row, violated=violated), 0.0
    links = [*recorded.links.warnings, *sorted(recorded.links.failures)]
    unlike = "" if recorded.reproducible else "something happened that the scenario does not say"
    asked = {ENDS: "", ERROR: unlike, LINKS: "; ".join(links[:2])}
    failed = {it.check: it.sentence for it in verdicts if it.status == "failed"}
    passed = [name for name, text in asked.items() if not text]
    row = msgspec.structs.replace(
        row,
        passed=(*passed, *(it.check for it in verdicts if it.status == "passed")),
        violated={name: text for name, text in asked.items() if text} | failed,
        history_sha256=recorded.sha256,
        links_sha256=recorded.links.sha256,
        trips=sum(bool(tripped_by(event)) for event in recorded.events),
    )
    return row, restored_from(recorded.events, scenario.protection.enter_service)


# -------------------------------------------------------------------- what the machine lacks


_ERRORS = (
    *(errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE),
    *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.ESTALE),
)
_NUMBER = f"(?:{'|'.join(map(str, _ERRORS))})"

_WORDS = re.compile(
    rf"MemoryError|\[Errno {_NUMBER}\]|os error {_NUMBER}\)|Os {{ code: {_NUMBER},|memory allocation of \d+ bytes"
    r"|failed to map segment from|can't start new thread|Zenoh cannot start its threads|may have \d+ files open at once"
    r"|was killed by SIGKILL"
)
"""Words of Python, Rust and the loader for a lack, in an error or in the last lines of a process that ended. In
simulated time a run sends SIGKILL to no process of its own before it has its verdict: a system without memory does."""


class MachineError(Exception):
    """The machine lacks what a run needs, as room on a disk; made from the line that tells of it."""

    def __init__(self, line: str) -> None:
        super().__init__(
            f"the machine lacks what a run needs ({line}); end other programs, do fewer runs at a time (--jobs), make "
            f"room in {tempfile.gettempdir()} or set TMPDIR to another folder, or raise the limit (ulimit)"
        )


def machine_error(*told: BaseException | str) -> MachineError | None:
    r"""Return the lack that errors of a run, or texts on its processes, laws and checks, name; None if they name none.

    Examples
    --------
    >>> str(machine_error("inv1 exited with status 1.\n  OSError: [Errno 24] Too many open files")).partition(";")[0]
    'the machine lacks what a run needs (OSError: [Errno 24] Too many open files)'
    >>> machine_error(FileNotFoundError(errno.ENOENT, "No such file", "mine.csv"))
    """
    for text in (text for it in told for text in ([it] if isinstance(it, str) else _texts(it))):
        if lines := [line for line in text.splitlines() if _WORDS.search(line)]:
            return MachineError(lines[-1].strip())  # an error ends its traceback
    return None


def _texts(error: BaseException | None) -> Iterator[str]:
    """Yield the text of an error, and of those that led to it, also where `raise ... from None` hides them."""
    while error is not None:
        yield f"{type(error).__name__}: {error}".rstrip(": ")
        error = error.__cause__ or error.__context__
