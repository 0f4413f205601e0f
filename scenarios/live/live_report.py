"""Report of a live run: metrics.json, report.txt and figures, as `gridpeers run` makes them for a case."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import msgspec

from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.console import terminal
from gridpeers.scenarios.live.departures import Departures, compare, few
from gridpeers.scenarios.live.live_processes import ProcessOutcome
from gridpeers.scenarios.measured_run import case_facts, write_measures
from gridpeers.scenarios.results.history import as_they_came, late_moves
from gridpeers.scenarios.results.island_membership import taken_part
from gridpeers.scenarios.results.plots.drawing import Drawing, Mark, drawing_of
from gridpeers.scenarios.results.record import Recorded
from gridpeers.scenarios.results.report import RunReport, show
from gridpeers.scenarios.results.run_files import set_broken, set_complete, shown
from gridpeers.scenarios.run_request import Request
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.wire.driver.drive import StoppedError
from gridpeers.wire.messages import Pacing, PlantEvent


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
    """Yield a mark at each time at which people departed from the scenario, with the names of what they moved."""
    for t in dict.fromkeys(event.t for event in departures if event.t > 0.0):
        of = [event for event in departures if event.t == t]
        label = "live" if any(event.kind in ("switch", "load") for event in of) else ""
        yield Mark(label, t, ", ".join(dict.fromkeys(event.subject for event in of)))


def write_report(metrics: Request, recorded: Recorded, pacing: Pacing | None, *, figures: bool = True) -> RunReport:
    """Measure the record of a live run of one case; write metrics.json, report.txt and figures into its folder.

    It judges no claim of the paper, as people may have changed the run. StoppedError or KeyboardInterrupt if a signal
    ends it.
    """
    scenario, feeder, (case,) = metrics.scenario, metrics.feeder, metrics.scenario.cases
    departures = compare(scenario, feeder, recorded.events, recorded.ended, recorded.missing)
    whole = CheckedCase.of(scenario, feeder, case, recorded, metrics.folder / case, departures.measured)
    taken = replace(whole, history=taken_part(scenario, feeder, whole.history))
    report = write_measures(
        metrics,
        {case: taken},
        {case: case_facts(recorded, pacing)},
        [f"case {case}: {note}" for note in _notes(scenario, recorded, departures)],
        place=shown(metrics.folder) + "/",
        disturbed=bool(departures.disturbed),
        live=_live_table(recorded, departures),
    )
    if figures:
        from gridpeers.scenarios.results.plots.run_figures import draw_all  # matplotlib takes longest to import

        draw_all(live_drawing(departures, taken), metrics.folder / "plots")
    return report


def _live_table(recorded: Recorded, departures: Departures) -> dict[str, object]:
    table: dict[str, object] = {
        "ended_s": recorded.ended,
        "windows": {
            window.label: {"t_s": window.start, "end_s": window.end, "what": departures.live[window.label]}
            for window in departures.measured
            if window.label in departures.live
        },
        "unmeasured": [window.label for window in departures.unmeasured],
        "disturbed": [window.label for window in departures.disturbed],
        "departures": departures.lines,
    }
    missing = [{"after_s": a, "before_s": b} for a, b in recorded.missing]
    return table | ({"missing": missing} if missing else {})


def _notes(scenario: ScenarioModel, recorded: Recorded, departures: Departures) -> Iterable[str]:
    end_s = scenario.time.end_s
    if not scenario.events and not departures.live:
        yield "the scenario has no event, and nobody made one, so there is no window to measure in"
    elif end_s < recorded.ended and all(window.end <= end_s for window in departures.measured):
        yield f"measured up to {end_s:g} s, where the scenario ends; the history goes on to {recorded.ended:.2f} s"
    if departures.unmeasured:
        spans = ", ".join(f"{window.label} ({window.start:g} to {window.end:g} s)" for window in departures.unmeasured)
        yield f"ended at {recorded.ended:.2f} s; not reached, too short, or without rows, so without numbers: {spans}"
    if departures.live:
        lines = [f"{label}: {what}" for label, what in departures.live.items()]
        yield f"events that the scenario does not have: {few(lines)}"
    if recorded.missing:
        spans = ", ".join(f"{before:.2f} and {after:.2f} s" for before, after in recorded.missing)
        yield f"rows are missing between {spans}, as the record was out of the plant's reach"
    yield from late_moves(scenario, recorded.events)
    if departures.note:
        yield departures.note


def conclude(outcome: ProcessOutcome, metrics: Request) -> ProcessOutcome:
    """Write and show the report of a run that has ended, and note in its folder how it ended.

    Ctrl-C and SIGTERM are good ends of a live run. Only a second one leaves it without numbers.
    """
    folder, recorded = metrics.folder, outcome.recorded
    if outcome.broke or recorded is None:
        set_broken(folder, outcome.broke or "no whole record")
        return outcome
    try:
        show(write_report(metrics, recorded, outcome.pacing), terminal())
        set_complete(folder)
    except (StoppedError, KeyboardInterrupt) as stop:
        set_broken(folder, "interrupted while its numbers were made")
        return replace(outcome, interrupted=str(stop) or "SIGINT")
    except OSError as error:
        broke = f"its numbers cannot be written: {error.strerror or error}"
        set_broken(folder, broke)
        return replace(outcome, broke=broke)
    return outcome
