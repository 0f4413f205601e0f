"""What a run by hand came to: metrics.json, report.txt and figures, as `gridpeers run` makes them of a case."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from scenarios.live.link_log import LinkLog
from scenarios.live.numbers.departures import Compared, compare
from scenarios.live.numbers.live_figures import drawing_by_hand
from scenarios.results.benchmark_registry import NO_BENCHMARK, benchmark_of
from scenarios.results.findings import find_in
from scenarios.results.history import History
from scenarios.results.island_membership import taken_part
from scenarios.results.joins_and_leaves import late_moves
from scenarios.results.metrics import Window, messages_saved
from scenarios.results.metrics_file import RunMetrics, metrics_json
from scenarios.results.own.window_metrics import own_measures
from scenarios.results.record import Recorded
from scenarios.results.report import RunReport, plain
from scenarios.results.run_files import shown, write_whole
from scenarios.spec.agentless import with_agent
from wire.messages import Pacing

_SHOWN = 3
"""So many departures are told in a note; all of them are in metrics.json."""


class LiveReport:
    """Takes the record of a run by hand once it is whole, and gives account of it.

    Parameters
    ----------
    ran : RunMetrics
        The run: its scenario has one case, and its folder is there.
    book : LinkLog
        What emulated links did.
    """

    def __init__(self, ran: RunMetrics, book: LinkLog) -> None:
        self._ran, self._book = ran, book
        (self._case,) = ran.scenario.cases
        self._recorded: Recorded | None = None
        self._pacing: Pacing | None = None

    def __call__(self, recorded: Recorded, pacing: Pacing | None) -> None:
        """Take the record, and how the plant kept pace."""
        self._recorded, self._pacing = recorded, pacing

    @property
    def ready(self) -> bool:
        """Whether there is a whole record to give account of."""
        return self._recorded is not None

    def write(self) -> RunReport:
        """Measure what windows there are, write it with its figures, and return what there is to tell.

        No claim of the paper is judged: a run by hand is one case, and people had their hands in it.
        """
        assert self._recorded is not None
        ran, case, recorded = self._ran, self._case, self._recorded
        compared = compare(ran.scenario, ran.feeder, recorded.events, recorded.ended, recorded.missing)
        history, plates = taken_part(ran.scenario, ran.feeder, History.of(recorded.inverters, recorded.rows))
        found = find_in({case: compared.opened.measured}, compared.happened, ran.feeder, plates, {case: history})
        saved = messages_saved(
            recorded.quiet,
            compared.opened.measured,
            len(with_agent(ran.scenario, ran.feeder, case)),
            ran.scenario.time.T_c_s,
        )
        own = own_measures(
            compared.happened, ran.feeder, plates, {case: history}, {case: compared.opened.measured}, {case: saved}
        )
        found = replace(found, own=own)
        report = RunReport(
            scenario=ran.scenario.name,
            titles={case: ran.scenario.cases[case].title},
            found=found,
            verdicts=(),
            benchmark=NO_BENCHMARK if compared.disturbed else benchmark_of(ran.scenario.paper),
            notes=[f"case {case}: {note}" for note in self._notes(compared)],
            folder=shown(ran.folder) + "/",
        )
        pacing = {} if self._pacing is None else {case: self._pacing}
        links = {case: sha256} if (sha256 := self._book.links_sha256) else {}
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
            metrics_json(ran, found, {case: recorded.sha256}, pacing, links, by_hand, saved={case: saved}),
        )
        write_whole(ran.folder / "report.txt", plain(report))

        from scenarios.results.plots import draw_all  # matplotlib takes longer to import than all else

        draw_all(
            drawing_by_hand(compared, ran.scenario, ran.feeder, case, history, recorded.events), ran.folder / "plots"
        )
        return report

    def _notes(self, compared: Compared) -> Iterable[str]:
        """What a reader must know of these numbers."""
        assert self._recorded is not None
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
    """Windows with their times."""
    return ", ".join(f"{window.label} ({window.start:g} to {window.end:g} s)" for window in windows)


def _windows(compared: Compared) -> dict[str, Any]:
    """Windows that people opened and that are measured, by label: from when to when (s), and what was done."""
    return {
        window.label: {"t_s": window.start, "end_s": window.end, "what": compared.by_hand[window.label]}
        for window in compared.opened.measured
        if window.label in compared.by_hand
    }


def _few(lines: Sequence[str]) -> str:
    """The first of some lines, and how many there are more."""
    more = f", and {len(lines) - _SHOWN} more (metrics.json)" if len(lines) > _SHOWN else ""
    return f"{'; '.join(lines[:_SHOWN])}{more}"
