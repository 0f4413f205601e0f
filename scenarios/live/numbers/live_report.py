"""Report of a live run: metrics.json, report.txt and figures, as `gridpeers run` makes them for a case."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from rich.console import Console

from scenarios.live.live_folders import Folders
from scenarios.live.live_processes import ProcessOutcome
from scenarios.live.numbers.departures import Compared, compare
from scenarios.live.numbers.live_figures import drawing_by_hand
from scenarios.results.evaluation.benchmark_registry import NO_BENCHMARK, benchmark_of
from scenarios.results.event_windows import CaseRecord, Window, late_moves
from scenarios.results.findings import find
from scenarios.results.island_membership import taken_part
from scenarios.results.metrics_file import RunMetrics, case_facts, metrics_json
from scenarios.results.record import Recorded
from scenarios.results.report import RunReport, plain, show
from scenarios.results.run_files import shown, write_whole
from wire.driver.drive import StoppedError
from wire.messages import Pacing

_SHOWN = 3
"""Most departures in a note; metrics.json has all of them."""


class LiveReport:
    """Measure the record of a live run, and write metrics.json, report.txt and figures into its folder.

    Parameters
    ----------
    ran : RunMetrics
        The run: its scenario has one case, and its folder exists.
    recorded : Recorded
        The whole record.
    pacing : Pacing or None
        How the plant kept pace.
    """

    def __init__(self, ran: RunMetrics, recorded: Recorded, pacing: Pacing | None) -> None:
        self._ran, self._recorded, self._pacing = ran, recorded, pacing
        (self._case,) = ran.scenario.cases

    def write(self) -> RunReport:
        """Measure all windows, write the numbers and figures, and return the report.

        It judges no claim of the paper: a live run has one case, and people may have changed it.
        """
        ran, case, recorded = self._ran, self._case, self._recorded
        compared = compare(ran.scenario, ran.feeder, recorded.events, recorded.ended, recorded.missing)
        record = CaseRecord.of(compared.happened, ran.feeder, case, recorded, compared.opened.measured)
        record = replace(record, history=taken_part(ran.scenario, ran.feeder, record.history))
        found = find(compared.happened, ran.feeder, {case: record})
        report = RunReport(
            scenario=ran.scenario.name,
            titles={case: ran.scenario.cases[case].title},
            found=found,
            verdicts=(),
            benchmark=NO_BENCHMARK if compared.disturbed else benchmark_of(ran.scenario.paper),
            notes=[f"case {case}: {note}" for note in self._notes(compared)],
            folder=shown(ran.folder) + "/",
        )
        by_hand = {
            "ended_s": compared.ended,
            "windows": _windows(compared),
            "too_short": [window.label for window in compared.opened.too_short],
            "not_reached": [window.label for window in compared.opened.not_reached],
            "disturbed": compared.disturbed,
            "departures": compared.lines(),
        }
        if recorded.missing:
            by_hand["missing"] = [{"after_s": a, "before_s": b} for a, b in recorded.missing]
            by_hand["unrecorded"] = [window.label for window in compared.unrecorded]
        write_whole(
            ran.folder / "metrics.json",
            metrics_json(ran, found, {case: case_facts(recorded, self._pacing)}, by_hand),
        )
        write_whole(ran.folder / "report.txt", plain(report))

        from scenarios.results.plots.run_figures import draw_all  # matplotlib takes longer to import than all else

        draw_all(
            drawing_by_hand(compared, ran.scenario, ran.feeder, case, record.history, recorded.events),
            ran.folder / "plots",
        )
        return report

    def _notes(self, compared: Compared) -> Iterable[str]:
        """Yield what a reader must know of these numbers."""
        ended, scenario, windows = f"{compared.ended:.2f} s", self._ran.scenario, compared.opened
        if not scenario.events and not compared.by_hand:
            yield "the scenario has no event, and nobody made one, so there is no window to measure in"
        elif windows.not_reached:
            what = "they have no numbers" if windows.measured else "nothing was measured"
            yield f"ended at {ended}, before the end of {_named(windows.not_reached)}: {what}"
        elif scenario.time.end_s < compared.ended and all(w.end <= scenario.time.end_s for w in windows.measured):
            yield f"measured up to {scenario.time.end_s:g} s, where the scenario ends; the history goes on to {ended}"
        if compared.by_hand:
            lines = [f"{label}: {what}" for label, what in compared.by_hand.items()]
            yield f"events that the scenario does not have: {_few(lines)}"
        if self._recorded.missing:
            spans = ", ".join(f"{before:.2f} and {after:.2f} s" for before, after in self._recorded.missing)
            yield f"rows are missing between {spans}, as the record was out of the plant's reach"
        if compared.unrecorded:
            yield f"without rows where they are measured, so without numbers: {_named(compared.unrecorded)}"
        if windows.too_short:
            yield f"too short to be measured: {_named(windows.too_short)}"
        yield from late_moves(compared.measured, self._recorded.events)
        if compared.disturbed:
            lines = compared.lines(compared.measured.time.end_s) or ["rows that are missing"]
            names = ", ".join(compared.disturbed)
            yield f"{names}: not what the scenario means by it, which does not tell of: {_few(lines)}"


def _named(windows: Iterable[Window]) -> str:
    """Return windows with their times."""
    return ", ".join(f"{window.label} ({window.start:g} to {window.end:g} s)" for window in windows)


def _windows(compared: Compared) -> dict[str, Any]:
    """Return the measured windows that people opened, by label: start and end (s), and what they did."""
    return {
        window.label: {"t_s": window.start, "end_s": window.end, "what": compared.by_hand[window.label]}
        for window in compared.opened.measured
        if window.label in compared.by_hand
    }


def _few(lines: Sequence[str]) -> str:
    """Return the first lines, and the number of the others."""
    more = f", and {len(lines) - _SHOWN} more (metrics.json)" if len(lines) > _SHOWN else ""
    return f"{'; '.join(lines[:_SHOWN])}{more}"


def conclude(outcome: ProcessOutcome, ran: RunMetrics, folders: Folders) -> ProcessOutcome:
    """Write and show the report of a run that has ended, and note in its folder how it ended.

    Ctrl-C and SIGTERM are good ends of a live run. Only a second one leaves it without numbers.

    Parameters
    ----------
    outcome : ProcessOutcome
        How the run ended, with its record.
    ran : RunMetrics
        The run.
    folders : Folders
        With the run folder.
    """
    if outcome.broke or outcome.recorded is None:
        folders.broken(outcome.broke or "no whole record")
        return outcome
    try:
        show(LiveReport(ran, outcome.recorded, outcome.pacing).write(), Console())
        folders.complete()
    except (StoppedError, KeyboardInterrupt) as stop:
        folders.broken("interrupted while its numbers were made")
        return replace(outcome, interrupted=str(stop) or "SIGINT")
    except OSError as error:
        broke = f"its numbers cannot be written: {error.strerror or error}"
        folders.broken(broke)
        return replace(outcome, broke=broke)
    return outcome
