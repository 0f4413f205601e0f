"""One run of a campaign: from its schedule to its verdict.

A collapse that no control can prevent excuses violations of its inverters. Nothing that a run can do ends the campaign.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import msgspec

from gridpeers.lab.chaos.disturbed_scenario import RESTORED, WITHIN_S, ChaosBase, Schedule
from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.connectivity import bus_islands
from gridpeers.scenarios.checks.check_registry import LAW_FAILED
from gridpeers.scenarios.checks.check_verdict import SHOWN_VIOLATIONS, CheckVerdict, judge_case
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.results.island_membership import closed_switches
from gridpeers.scenarios.results.recorded_events import tripped_by, tripped_inverters
from gridpeers.scenarios.results.run_files import JournalRow
from gridpeers.scenarios.run import run_case
from gridpeers.scenarios.run_request import BrokenRunError, Driver, LawStopError, Request
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.sweep.sweep_case import plant_at_start
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import utf8

ASKED = ENDS, ERROR, LINKS, REPEATS, SAME_IN_PROCESSES = "ends", "no_error", "links", "repeats", "same_in_processes"
"""Questions about every run beside the checks: it reaches its end; no error of the program; the accounts of links
balance; a second run gives the same bytes; processes give the bytes of one process."""

LONGER_RUNS = 6
"""Most repetitions of a run with trips, each longer than the one before: inverters stay off after three trips without a
minute in service between them."""


PERIODS = 2
"""Control periods after a change within which trips are a collapse. The first measurement that shows the change is
taken at the end of the first period. What an agent decides on it acts during the second one, before any agent has heard
of the change from another, or has measured what a decision did."""


class ChaosRow(JournalRow, frozen=True, kw_only=True):
    schedule: Schedule
    passed: tuple[str, ...] = ()
    violated: dict[str, str] = msgspec.field(default_factory=dict)
    collapse: str = ""
    """Why violations of some inverters do not count: a change made them trip before any control could prevent it."""
    unsettled: str = ""
    """Why it may be judged too early: inverters tripped and returned in each longer run."""
    history_sha256: str = ""
    links_sha256: str = ""
    trips: int = 0
    since_s: float = 0.0
    """Run time (s) from which it must be restored: that of the last change, or later if inverters tripped."""
    took_s: float = 0.0

    @property
    def status(self) -> str:
        return "violated" if self.violated else "collapse" if self.collapse else "passed"


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
    """Run a scenario with a schedule and a seed of its own, and judge it.

    With processes it runs in one process too, and with `again` once more: both must give the same bytes. Temporary
    folders are made `within` that of the campaign.
    """
    began = monotonic()

    def settled(base: ChaosBase, schedule: Schedule, driver: Driver) -> JudgedRun:
        return _settled(base, schedule, seed, number, driver, within)

    row = _excused(base, schedule, driver, settled)
    if driver == "processes":
        row = compared(row, _excused(base, schedule, "inprocess", settled), SAME_IN_PROCESSES)
    if again:
        row = compared(row, _excused(base, schedule, driver, settled), REPEATS)
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


def _excused(
    base: ChaosBase, schedule: Schedule, driver: Driver, settled: Callable[[ChaosBase, Schedule, Driver], JudgedRun]
) -> ChaosRow:
    """Run a scenario with a schedule, and judge it without violations that a collapse before any control excuses."""
    run = settled(base, schedule, driver)
    row = run.row
    if not run.collapses or row.violated.keys().isdisjoint(RESTORED):
        return row
    changes, faultless = tuple(it for it in schedule if it.table == "event"), base.without_faults()
    plain = run
    if len(changes) < len(schedule) or faultless is not base:  # a fault of links or agents before may have led to it
        plain = settled(faultless, changes, "inprocess")
    without = {collapse.label: collapse.inverters for collapse in plain.collapses}
    # Who is in service again, or would be without faults, is to be restored like all others.
    lost = {it.label: it.inverters & without.get(it.label, frozenset()) & run.off & plain.off for it in run.collapses}
    others = unexcused(run.verdicts, frozenset().union(*lost.values()))
    violated = {name: others.get(name, text) for name, text in row.violated.items()}
    if violated == row.violated:
        return row
    return msgspec.structs.replace(
        row,
        violated={name: text for name, text in violated.items() if text},
        collapse="; ".join(collapse.text for collapse in run.collapses if lost[collapse.label]),
    )


def _settled(
    base: ChaosBase, schedule: Schedule, seed: int, number: int, driver: Driver, within: Path | None
) -> JudgedRun:
    """Run a scenario with a schedule. If inverters trip, run it again, until they are judged after their return."""
    since_s = base.changed_s(schedule)
    for _ in range(LONGER_RUNS):
        row = ChaosRow(number=number, schedule=schedule, since_s=since_s)
        run = judged(base, base.disturbed(schedule, seed, since_s), row, driver, within)
        if run.restored_s <= since_s:
            return run
        since_s = run.restored_s
    text = f"after {LONGER_RUNS} runs still judged from {row.since_s:g} s on, {since_s:g} s would be right"
    return run._replace(row=msgspec.structs.replace(run.row, unsettled=f"inverters trip and return: {text}"))


class JudgedRun(NamedTuple):
    row: ChaosRow
    restored_s: float = 0.0
    collapses: tuple[Collapse, ...] = ()
    off: frozenset[str] = frozenset()
    verdicts: tuple[CheckVerdict, ...] = ()


def judged(
    base: ChaosBase, scenario: ScenarioModel, row: ChaosRow, driver: Driver, within: Path | None = None
) -> JudgedRun:
    with tempfile.TemporaryDirectory(prefix="gridpeers-chaos-", dir=within, ignore_cleanup_errors=True) as name:
        folder = Path(name)
        request = Request(scenario=scenario, feeder=base.feeder, driver=driver, folder=folder, lasting=False)
        at_start = plant_at_start if scenario.plant.simulator == "gridpeers" and driver == "inprocess" else None
        try:
            recorded, _ = run_case(request, base.case, "", lambda case, t, end: None, at_start)
            case = CheckedCase.of(scenario, base.feeder, base.case, recorded, folder / base.case)
            verdicts = judge_case(case)
        except (OSError, MemoryError):  # the machine lacks room or memory, which is no failure of the scenario
            raise
        except Exception as error:
            violated = {ERROR: f"{type(error).__name__}: {error}"}
            if isinstance(error, BrokenRunError):
                violated = {LAW_FAILED if isinstance(error, LawStopError) else ENDS: str(error)}
            return JudgedRun(msgspec.structs.replace(row, violated=violated))
    links = [*recorded.links.warnings, *sorted(recorded.links.failures)]
    unlike = "" if recorded.reproducible else "an event happened that is not in the scenario"
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
    restored_s = restored_from(recorded.events, scenario.protection.enter_service)
    history = case.history
    present = zip(history.inverters, history.present[-1].tolist(), strict=True)
    off = frozenset(name for name, on in present if not on)
    return JudgedRun(row, restored_s, collapses_at_changes(scenario, base.feeder, recorded.events), off, verdicts)


# -------------------------------------------------------------------- collapses


class Collapse(NamedTuple):
    label: str
    text: str
    inverters: frozenset[str]
    """Inverters of the islands with trips, by the switch positions of that time."""


def collapses_at_changes(scenario: ScenarioModel, feeder: Tables, events: Iterable[PlantEvent]) -> tuple[Collapse, ...]:
    """Return the collapses of a run, one for each change that makes inverters trip within `PERIODS`.

    The first trip of an inverter counts alone: who has tripped before may trip again for the reason of that time.
    """
    rows = (*feeder.inverters, *feeder.spares)
    bus_of = {row.name: row.bus for row in rows}
    longest = PERIODS * scenario.time.T_c_s + 1e-9
    switched: list[PlantEvent] = []
    tripped: set[str] = set()
    found: dict[str, Collapse] = {}
    for event in events:
        if event.kind == "switch":
            switched.append(event)
        first = set(tripped_by(event)) - tripped
        tripped |= first
        since = [change.label for change in scenario.events if -1e-9 <= event.t - change.t_s <= longest]
        if not first or not since:
            continue
        label, buses = since[-1], {bus_of[name] for name in first}
        islands = [each for each in bus_islands(feeder, closed_switches(feeder, switched)) if each & buses]
        members = frozenset(row.name for row in rows if any(row.bus in island for island in islands))
        before = found.get(label, Collapse(label, f"{label}: at t = {event.t:g} s {event.text}", frozenset()))
        found[label] = before._replace(inverters=before.inverters | members)
    return tuple(found.values())


def unexcused(verdicts: Iterable[CheckVerdict], excused: frozenset[str]) -> dict[str, str]:
    """Return the failed checks of `RESTORED`, each with a sentence on its violations by inverters that are not excused.

    A sentence is empty if only excused inverters violate the check. A violation that names no inverter counts.
    """
    found = {}
    for verdict in verdicts:
        if verdict.status == "failed" and verdict.check in RESTORED:
            rest = tuple(violation for violation in verdict.violations if violation.agent not in excused)
            count = verdict.count - len(verdict.violations) + len(rest)
            beyond = "" if rest else f"{count} violations, beyond the {SHOWN_VIOLATIONS} that a verdict keeps"
            reason = verdict.reason or beyond
            of_others = msgspec.structs.replace(verdict, violations=rest, count=count, reason=reason)
            found[verdict.check] = of_others.sentence if count or verdict.reason else ""
    return found
