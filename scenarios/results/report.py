"""The end of a run in words: a summary of one screen, and the report with every number, claim and check."""

from __future__ import annotations

import math
import re
import textwrap
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.util import find_spec

from rich.cells import cell_len, set_cell_size
from rich.console import Console
from rich.text import Text

from gridpeers.scenarios.checks.check_registry import LAW_FAILED
from gridpeers.scenarios.checks.check_verdict import CheckVerdict, counts
from gridpeers.scenarios.console import text_of
from gridpeers.scenarios.results.claims import NO_BENCHMARK, Benchmark, Verdict
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.metric import DIGITS, UNITS, Quantity, heading, label
from gridpeers.scenarios.results.metrics import SHARING, STEADY, Steady
from gridpeers.scenarios.results.recorded_events import LawFailure, first_of
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.wording import counted

GAP = 2  # Spaces behind a column


_COLOURS = {"PASS": "green", "FAIL": "bold red", "MISS": "yellow", "NOT RUN": "dim"}


@dataclass(frozen=True, kw_only=True)
class RunReport:
    scenario: str
    titles: Mapping[str, str]
    findings: Findings
    verdicts: Sequence[Verdict]
    benchmark: Benchmark = NO_BENCHMARK
    """The publication of the experiment; its numbers stand beside ours."""
    checks: Mapping[str, tuple[CheckVerdict, ...]] = field(default_factory=dict)
    expected: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Checks that each case is built to fail."""
    failures: Mapping[str, tuple[LawFailure, ...]] = field(default_factory=dict)
    notes: Sequence[str]
    folder: str
    """Folder of the results; "" for one that goes with them."""

    def fails(self, *, checks: bool) -> bool:
        """Return True if a claim or a law failed, or, with `checks`, a check that its case is not built to fail."""
        failed = {verdict.check for of in self.checks.values() for verdict in of if verdict.status == "failed"}
        claims = any(verdict.status == "FAIL" for verdict in self.verdicts)
        return claims or LAW_FAILED in failed or (checks and any(map(self.broken, self.checks)))

    def broken(self, case: str) -> list[CheckVerdict]:
        """Return the checks that a case fails though it is not built to."""
        failed = (verdict for verdict in self.checks.get(case, ()) if verdict.status == "failed")
        return [verdict for verdict in failed if verdict.check not in self.expected.get(case, ())]


def plain(report: RunReport) -> str:
    return text_of(lambda console: show(report, console))


LINES, COLUMNS = 14, 80  # Size of a summary; one line of a screen is for what comes before it


def show_summary(report: RunReport, console: Console, after: str, figure: str = "png") -> None:
    """Print the answer of a run on one screen: what failed, each case, the claims, the files, the next command.

    `after` is the command to type next if nothing failed and no browser shows runs; `figure` is the kind of picture.
    """
    failed = [*_failures(report)]
    tail = _claims_that_hold(report)
    if report.folder:
        more = f" ({counted(len(report.notes), 'note')})" if report.notes else ""
        tail += [Text.assemble(f"{'figure':8}", (f"{report.folder}plots/overview.{figure}", "bold"))]
        tail += [Text(f"{'report':8}{report.folder}report.txt{more}"), Text(f"{'next':8}{_next(report, after)}")]
    room = LINES - 4 - len(tail) - min(len(report.checks), 5)
    shown = [textwrap.wrap(line, COLUMNS, subsequent_indent=" " * 8) for line in failed]
    if sum(map(len, shown)) > room:
        shown = [[_cut(line)] for line in (failed if len(failed) <= room else failed[: room - 1])]
    head = [_answer(report, failed), *(Text(line, "red") for lines in shown for line in lines)]
    if len(shown) < len(failed):
        head.append(Text(f"and {len(failed) - len(shown)} more failures: see the report", "red"))
    table = _cases(report, LINES - len(head) - len(tail))
    room = LINES - len(head) - len(table) - len(tail)
    blank = [Text()] if room >= 2 else []
    table += [
        Text.assemble(("NOTE", "yellow"), _cut(f"  {note}", COLUMNS - 4))
        for note in report.notes[: max(room - 2 * len(blank), 0)]
    ]
    for line in (*head, *blank, *table, *blank, *tail):
        console.print(line, soft_wrap=True)


def _failures(report: RunReport) -> Iterator[str]:
    when = r" at t = [\d.]+ s"  # the time is in the next command
    yield from (f"FAILED  case {case}: {re.sub(when, '', first_of(of))}" for case, of in report.failures.items() if of)
    for case in report.checks:
        for verdict in report.broken(case):
            if verdict.check != LAW_FAILED or not report.failures.get(case):
                yield f"FAILED  case {case}: {verdict.check}: {re.sub(when, '', verdict.detail, count=1)}"
    yield from (f"FAILED  {it.claim.text}: {it.found}" for it in report.verdicts if it.status == "FAIL")


_STATES = {
    "law failed": ("run", "a law that failed", "law failed"),
    "broken": ("break", "limits", "broken"),
    "kept": ("keep", "all limits", "kept"),
    "expected": ("break", "limits as expected", "as expected"),
    "not judged": ("have", "no limit that was judged", "not judged"),
}
"""Verb and object of a sentence about cases by their state, and its words in a table."""


def _state(report: RunReport, case: str) -> str:
    of = {verdict.status for verdict in report.checks.get(case, ())}
    if report.failures.get(case):
        return "law failed"
    if report.broken(case):
        return "broken"
    return "expected" if "failed" in of else "kept" if "passed" in of else "not judged"


def _answer(report: RunReport, failed: Sequence[str]) -> Text:
    """Say which cases are in which state; only the first states name their cases if there is no room for all names."""
    states = {case: _state(report, case) for case in report.checks}
    groups = {state: [case for case in states if states[case] == state] for state in _STATES}
    groups = {state: of for state, of in groups.items() if of}
    wrong = sum(verdict.status == "FAIL" for verdict in report.verdicts)
    text = ""
    for named in (len(groups), 1, 0):
        clauses = [f"{counted(wrong, 'claim')} failed"] if wrong else []
        for at, (state, of) in enumerate(groups.items()):
            verb, what, _ = _STATES[state]
            if len(of) == 1:
                verb = "has" if verb == "have" else f"{verb}s"
            if state == "expected" and "kept" in groups:
                what = "some as expected"  # "limits" are in the clause before
            who = counted(len(of), "case")
            if len(of) == len(states) > 1:
                who = f"all {who}"
            elif at < named:
                who = f"case {of[0]}" if len(of) == 1 else f"cases {', '.join(of[:-1])} and {of[-1]}"
            clauses.append(f"{who} {verb} {what}")
        text = f"{report.scenario}: {'; '.join(clauses)}"
        if len(text) <= COLUMNS:
            break
    return Text(_cut(text), "bold red" if failed else "bold")


_IN_SHORT = {"f_error_Hz": "f error", "MPSI": "uneven P", "MQSI": "uneven Q", "t_restore_s": "restored in"}
"""Columns of the table of cases: fields of `Steady`, and headings that leave room in a line of `COLUMNS`."""


def _cases(report: RunReport, room: int) -> list[Text]:
    """Return a row for each case with its worst settled values of all events, as far as there is room."""
    found, cases = report.findings, [*report.checks]
    columns = _IN_SHORT if any(found.results.values()) else {}  # without an event there is no window to measure in
    room -= 1 + bool(columns)
    shown = cases if len(cases) <= room else cases[: max(room - 1, 1)]
    rows = [["case", *columns.values(), "limits"]]
    rows += [["", *(_worst(found, it, name) for name in columns), _STATES[_state(report, it)][2]] for it in shown]
    rest = sum(max(len(row[at]) for row in rows) + GAP for at in range(1, len(rows[0])))
    for row, case in zip(rows[1:], shown, strict=True):
        row[0] = _cut(_case(report, case), COLUMNS - rest) if COLUMNS - rest > len(case) + GAP + 3 else case
    lines = _aligned(rows, left=(0, len(rows[0]) - 1))
    lines += [Text(f"and {len(cases) - len(shown)} more cases: see the report")] * (len(shown) < len(cases))
    words = "worst settled values of all events; uneven P, Q: MPSI, MQSI, 0 if shared equally"
    return lines + [Text(words, "dim")] * bool(columns)


def _worst(found: Findings, case: str, name: str) -> str:
    """Return the largest value of a measure after any event, in any island, or in a word why there is none."""
    parts = [
        part
        for event, whole in found.results.get(case, {}).items()
        for part in (found.apart(case, event) or {"": whole}).values()
    ]
    shared = [part for part in parts if not _nothing_shared(part, "MPSI" if name == "t_restore_s" else name)]
    reasons = [part.reasons[name].partition(":")[0] for part in shared if name in part.reasons]
    values = [getattr(part, name) for part in shared]
    if reasons or not values:
        return (reasons or ["-"])[0]
    if None in values:
        return "never"
    return f"{max(values):.2f} s" if name == "t_restore_s" else f"{max(values):.3f}{UNITS[name]}"


def _claims_that_hold(report: RunReport) -> list[Text]:
    of = Counter(verdict.status for verdict in report.verdicts)
    rest = f", {counted(of['MISS'], 'known deviation')}" if of["MISS"] else ""
    rest += f", {of['NOT RUN']} need other cases" if of["NOT RUN"] else ""
    paper = " of the paper" if report.benchmark.numbers else ""
    return [Text(f"{of['PASS']} of {of.total() - of['NOT RUN']} claims{paper} hold{rest}")] if report.verdicts else []


def _next(report: RunReport, after: str) -> str:
    folder = report.folder.rstrip("/")
    for case in report.checks:
        for verdict in report.broken(case):
            for it in verdict.violations:
                if it.agent and it.t is not None:
                    return command_line("why", f"{folder}/{case}", it.agent, f"{it.t:.2f}")
    return command_line("view", folder) if find_spec("starlette") else after


def _cut(text: str, width: int = COLUMNS) -> str:
    return text if cell_len(text) <= width else f"{set_cell_size(text, width - 3).rstrip()}..."


def show(report: RunReport, console: Console) -> None:
    blocks: list[list[Text]] = [
        [Text(f"FAILED  case {case}: {first_of(of)}", "bold red") for case, of in report.failures.items() if of],
        *_tables(report),
        [*_claims(report)],
        [line for case in report.checks for line in _checks(report, case)],
    ]
    blocks += [[Text.assemble(("NOTE", "yellow"), f"  {note}")] for note in report.notes]
    blocks += [[Text.assemble("Results: ", (report.folder, "bold"))]] if report.folder else []
    for number, block in enumerate(filter(None, blocks)):
        if number:
            console.print()
        for line in block:
            console.print(line, soft_wrap=True)


def _claims(report: RunReport) -> Iterator[Text]:
    """Yield a line for each claim, how many of them hold, and the distance from the publication."""
    width = max((len(verdict.claim.text) for verdict in report.verdicts), default=0)
    for verdict in report.verdicts:
        status = (f"{verdict.status:7}", _COLOURS[verdict.status])
        yield Text.assemble(status, f"  {verdict.claim.text:{width}}", (f"  {verdict.found}".rstrip(), "dim"))
        if verdict.status == "MISS":
            yield Text(f"{'':7}  {verdict.claim.known_miss}", style="dim")
    yield from _claims_that_hold(report)
    yield from map(Text, report.benchmark.lines(report.findings) if report.verdicts else ())


def _checks(report: RunReport, case: str) -> Iterator[Text]:
    """Yield the counts of a case, and a line for each check that failed, as expected or not."""
    verdicts, broken = report.checks[case], report.broken(case)
    failed = [verdict for verdict in verdicts if verdict.status == "failed"]
    yield Text.assemble(("CHECKS", "yellow" if failed else "green"), f"  case {case}: {counts(verdicts)}")
    for it in failed:
        said = it.sentence if it in broken else it.sentence.replace(" failed", " failed as expected", 1)
        yield Text(f"{'':8}{said}")


def _tables(report: RunReport) -> Iterator[list[Text]]:
    """Yield our results as the paper's Tables I and II have them, with its numbers beside ours, and own metrics."""
    if any(report.findings.results.values()):  # without events there is no window to measure in
        yield _table_of(report, "Frequency and power sharing", ("f_error_Hz", "MPSI"))
        yield _table_of(report, "Voltage and var sharing", ("V_error", "MQSI"))
        if report.findings.own:
            yield _own_metrics(report)


def _titled(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], legend: Sequence[str]) -> list[Text]:
    """Return a table whose first two columns name the rows; the lines below it say why a cell is no number."""
    return [Text(title, "bold"), *_aligned((header, *rows), left=(0, 1)), *(Text(line, "dim") for line in legend)]


def _aligned(rows: Sequence[Sequence[str]], left: Collection[int]) -> list[Text]:
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        blank = [" " * (width - cell_len(cell)) for cell, width in zip(row, widths, strict=True)]
        cells = (cell + blank[at] if at in left else blank[at] + cell for at, cell in enumerate(row))
        lines.append(Text((" " * GAP).join(cells).rstrip()))
        lines[-1].highlight_regex(r"\S+ \| \S+ !|(broken|law failed)$", "red")
    return lines


def _table_of(report: RunReport, title: str, quantities: tuple[Quantity, ...]) -> list[Text]:
    """Return a table of some quantities; what is shared means nothing over several islands, and is a dash there.

    A value that is not steady is no number: the first words of its reason stand there, and all of it below the table.
    """
    found, rows, legend = report.findings, list[list[str]](), list[str]()
    timed = "f_error_Hz" in quantities
    for event, case, island, values in _places(found):
        dashes = SHARING if found.apart(case, event) and not island else ()
        cells = ["-" if name in dashes else _cell(report, case, event, name, values, island) for name in quantities]
        if timed:
            restored = "never" if values.t_restore_s is None else f"{values.t_restore_s:.2f} s"
            cells.append("-" if dashes or _nothing_shared(values, "MPSI") else restored)
        rows.append([event, f"  island of {island}" if island else _case(report, case), *cells])
        where = f"case {case}, {event}" + (f", island of {island}" if island else "")
        unsteady = (name for name in quantities if name in values.reasons and name not in dashes)
        legend += [f"{where}: {_why(values, name, found.f_nom)}" for name in unsteady]
    beside = [one for one in report.benchmark.numbers if one.quantity in quantities and found.has(one)]
    sources = dict.fromkeys(one.source for one in beside)
    against = f", ours | paper's {' and '.join(sources)}" if sources else ""
    if any(found.islands.values()):
        legend.insert(0, "-: several islands, each of which shares for itself: see the rows of the islands")
    header = ["event", "case", *(heading(quantity, found.f_nom) for quantity in quantities)]
    header += ["restored in"] if timed else []
    return _titled(f"{title} after each event{against}", header, rows, legend)


def _places(found: Findings) -> Iterator[tuple[str, str, str, Steady]]:
    """Yield event, case, island ("" for all of it) and steady values of each row."""
    for event in dict.fromkeys(event for steady in found.results.values() for event in steady):
        for case in (case for case, steady in found.results.items() if event in steady):
            yield event, case, "", found.results[case][event]
            yield from ((event, case, island, values) for island, values in found.apart(case, event).items())


def _case(report: RunReport, case: str) -> str:
    return f"{case}: {title}" if (title := report.titles.get(case)) else case


def _cell(report: RunReport, case: str, event: str, quantity: Quantity, values: Steady, island: str) -> str:
    """Write a number beside the paper's; one digit more than it prints, and "!" where it is not near enough."""
    paper = report.benchmark.number(case, event, quantity, island)
    ours, reason = getattr(values, quantity), values.reasons.get(quantity, "")
    text = reason.partition(":")[0] or f"{ours:.{(paper.digits if paper else DIGITS[quantity]) + 1}f}"
    if paper is None:
        return text
    return f"{text} | {paper.paper:.{paper.digits}f}{' !' if report.findings.within(paper) is False else ''}"


def _why(values: Steady, name: Quantity, f_nom: float) -> str:
    """Return why a number is not shown, with the mean of the last 0.2 s."""
    mean = getattr(values, name)
    dust = math.isnan(mean) or _nothing_shared(values, name)
    last = "" if dust else f" (mean of the last {STEADY:g} s: {mean:.3f}{UNITS[name]})"
    return f"{label(name, f_nom)} {values.reasons[name]}{last}"


def _nothing_shared(values: Steady, name: str) -> bool:
    """Return True if there is too little power for a sharing index to mean anything."""
    return values.reasons.get(name, "").startswith("nothing shared")


def _own_metrics(report: RunReport) -> list[Text]:
    own, rows, legend = report.findings.own, [], []
    names = dict.fromkeys(name for of in own.values() for measured in of.values() for name in measured.values)
    for event in dict.fromkeys(event for of in own.values() for event in of):
        for case, measured in ((case, of[event]) for case, of in own.items() if event in of):
            values = (measured.values.get(name) for name in names)
            rows.append([event, _case(report, case), *("-" if value is None else f"{value:.5g}" for value in values)])
            legend += [f"case {case}, {event}: {name} {text}" for name, text in measured.reasons.items()]
    return _titled("Metrics of the scenario", ["event", "case", *names], rows, legend)
