"""Report of a live run: metrics.json, report.txt and figures, as `gridpeers run` makes them for a case."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

import msgspec

from gridpeers.scenarios.checks.check_verdict import FILE, verdicts_json
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.checks.judging import JudgingStop, judge_case
from gridpeers.scenarios.console import terminal
from gridpeers.scenarios.live.departures import Departures, compare, few
from gridpeers.scenarios.live.live_files import ended_scenario, write_scenario
from gridpeers.scenarios.live.live_processes import ProcessOutcome
from gridpeers.scenarios.results.claims import NO_BENCHMARK, benchmark_of
from gridpeers.scenarios.results.findings import find
from gridpeers.scenarios.results.history import Window, as_they_came, late_moves, messages_saved
from gridpeers.scenarios.results.island_membership import taken_part
from gridpeers.scenarios.results.metrics_file import RunMetrics, case_facts, metrics_json
from gridpeers.scenarios.results.plots.drawing import Drawing, Mark, drawing_of
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.results.recorded_events import law_failures
from gridpeers.scenarios.results.report import RunReport, plain, show
from gridpeers.scenarios.results.run_files import set_broken, set_complete, shown, write_whole
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.messages import Pacing, PlantEvent

PRESENT = {"opened": "opens", "closed": "closes", "joined": "joins", "left": "leaves", "died": "dies"}
"""Verbs of the plant's events, and the same in figures."""


def live_drawing(departures: Departures, case: CheckedCase) -> Drawing:
    """Return the data of the figures of a live run, whose scenario has this case alone."""
    scenario = case.scenario
    reached = tuple(event for event in scenario.events if event.t_s < case.history.t[-1])
    came = as_they_came(msgspec.structs.replace(scenario, events=reached), case.events)
    taken = replace(case, history=taken_part(scenario, case.feeder, case.history))
    drawing = drawing_of(scenario, {case.case: taken}, came)
    marks = [*drawing.events, *_marks(departures.events)]
    return replace(drawing, events=marks, moves=any(event.kind == "inverter" for event in case.events))


def _marks(departures: Iterable[PlantEvent]) -> Iterator[Mark]:
    by_time: dict[float, list[PlantEvent]] = {}
    for event in departures:
        if event.t > 0.0:
            by_time.setdefault(event.t, []).append(event)
    for t, of in by_time.items():
        what = ", ".join(dict.fromkeys(text for event in of if (text := _in_short(event))))
        yield Mark("live" if any(event.kind in ("switch", "load") for event in of) else "", t, what)


def _in_short(event: PlantEvent) -> str:
    """Return a departure in two words; "" if that takes more."""
    if event.kind == "link":
        return "links"
    if event.kind == "load":
        return f"load {event.subject}"
    match = re.match(r"(?:switch )?(\S+)(?: \(.*\))? (opened|closed|joined|left|died)\b", event.text)
    return f"{match[1]} {PRESENT[match[2]]}" if match else ""


def write_report(metrics: RunMetrics, recorded: Recorded, pacing: Pacing | None, *, figures: bool = True) -> RunReport:
    """Measure the record of a live run of one case; write metrics.json, report.txt and figures into its folder.

    It judges no claim of the paper, as people may have changed the run. StoppedError or KeyboardInterrupt if a signal
    ends it: the report says then what checks did not judge.
    """
    scenario, feeder, (case,) = metrics.scenario, metrics.feeder, metrics.scenario.cases
    departures = compare(scenario, feeder, recorded.events, recorded.ended, recorded.missing)
    whole = CheckedCase.of(scenario, feeder, case, recorded, metrics.folder / case)
    measured = departures.those("measured")
    saved = messages_saved(scenario, feeder, case, recorded.quiet, measured)
    rows = taken_part(scenario, feeder, whole.history)
    taken = replace(whole, history=rows, windows=measured, messages_saved=saved)
    findings = find({case: taken})
    stop = JudgingStop(StoppedError, KeyboardInterrupt)
    checks = {case: judge_case(taken, stop)}
    report = RunReport(
        scenario=scenario.name,
        titles={case: scenario.cases[case].title},
        findings=findings,
        verdicts=(),
        benchmark=NO_BENCHMARK if departures.disturbed else benchmark_of(scenario.paper),
        checks=checks,
        failures={case: law_failures(recorded.events)},
        notes=[f"case {case}: {note}" for note in _notes(scenario, recorded, departures)],
        folder=shown(metrics.folder) + "/",
    )
    facts = {case: case_facts(recorded, pacing)}
    write_whole(
        metrics.folder / "metrics.json", metrics_json(metrics, findings, facts, _live_table(recorded, departures))
    )
    write_whole(metrics.folder / FILE, verdicts_json(checks))
    write_whole(metrics.folder / "report.txt", plain(report))
    stop.end()
    if not figures:
        return report
    from gridpeers.scenarios.results.plots.run_figures import draw_all  # matplotlib takes longest to import

    draw_all(live_drawing(departures, taken), metrics.folder / "plots")
    return report


def _live_table(recorded: Recorded, departures: Departures) -> dict[str, object]:
    table: dict[str, object] = {
        "ended_s": recorded.ended,
        "windows": {
            window.label: {"t_s": window.start, "end_s": window.end, "what": departures.live[window.label]}
            for window in departures.those("measured")
            if window.label in departures.live
        },
        "too_short": _labels(departures.those("too_short")),
        "not_reached": _labels(departures.those("not_reached")),
        "disturbed": _labels(departures.disturbed),
        "departures": departures.lines(),
    }
    if recorded.missing:
        table["missing"] = [{"after_s": a, "before_s": b} for a, b in recorded.missing]
        table["unrecorded"] = _labels(departures.those("unrecorded"))
    return table


def _notes(scenario: ScenarioModel, recorded: Recorded, departures: Departures) -> Iterable[str]:
    ended, end_s, measured = f"{recorded.ended:.2f} s", scenario.time.end_s, departures.those("measured")
    if not scenario.events and not departures.live:
        yield "the scenario has no event, and nobody made one, so there is no window to measure in"
    elif not_reached := departures.those("not_reached"):
        what = "they have no numbers" if measured else "nothing was measured"
        yield f"ended at {ended}, before the end of {_named(not_reached)}: {what}"
    elif end_s < recorded.ended and all(window.end <= end_s for window in measured):
        yield f"measured up to {end_s:g} s, where the scenario ends; the history goes on to {ended}"
    if departures.live:
        lines = [f"{label}: {what}" for label, what in departures.live.items()]
        yield f"events that the scenario does not have: {few(lines)}"
    if recorded.missing:
        spans = ", ".join(f"{before:.2f} and {after:.2f} s" for before, after in recorded.missing)
        yield f"rows are missing between {spans}, as the record was out of the plant's reach"
    if unrecorded := departures.those("unrecorded"):
        yield f"without rows where they are measured, so without numbers: {_named(unrecorded)}"
    if too_short := departures.those("too_short"):
        yield f"too short to be measured: {_named(too_short)}"
    if recorded.record_failure:
        yield f"{recorded.record_failure}; the run went on without it"
    yield from late_moves(scenario, recorded.events)
    if departures.note:
        yield departures.note


def _labels(windows: Iterable[Window]) -> list[str]:
    return [window.label for window in windows]


def _named(windows: Iterable[Window]) -> str:
    return ", ".join(f"{window.label} ({window.start:g} to {window.end:g} s)" for window in windows)


def conclude(outcome: ProcessOutcome, metrics: RunMetrics) -> ProcessOutcome:
    """Write and show the report of a run that has ended, and note in its folder how it ended.

    Ctrl-C and SIGTERM are good ends of a live run. Only a second one leaves it without numbers.
    """
    folder, recorded = metrics.folder, outcome.recorded
    if outcome.broke or recorded is None:
        set_broken(folder, outcome.broke or "no whole record")
        return outcome
    try:
        # first: a signal may end what follows
        write_scenario(folder, *ended_scenario(metrics.scenario, recorded.ended))
        show(write_report(metrics, recorded, outcome.pacing), terminal())
        set_complete(folder, filter(None, [recorded.record_failure]))
    except (StoppedError, KeyboardInterrupt) as stop:
        set_broken(folder, "interrupted while its numbers were made")
        return replace(outcome, interrupted=str(stop) or "SIGINT")
    except OSError as error:
        broke = f"its numbers cannot be written: {error.strerror or error}"
        set_broken(folder, broke)
        return replace(outcome, broke=broke)
    return outcome
