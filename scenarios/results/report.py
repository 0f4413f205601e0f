"""The report at the end of a run: tables with our numbers beside the paper's, a verdict per claim, the folder."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from gridpeers.scenarios.checks.check_verdict import CheckVerdict, summary
from gridpeers.scenarios.console import text_of
from gridpeers.scenarios.results.claims import NO_BENCHMARK, Benchmark, Verdict
from gridpeers.scenarios.results.findings import Findings
from gridpeers.scenarios.results.metric import DIGITS, UNITS, Quantity, heading, label
from gridpeers.scenarios.results.metrics import SHARING, STEADY, Steady
from gridpeers.scenarios.results.recorded_events import LawFailure, first_of

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
    failures: Mapping[str, tuple[LawFailure, ...]] = field(default_factory=dict)
    notes: Sequence[str]
    folder: str
    """Folder of the results; "" for one that goes with them."""

    def fails(self, check: str = "") -> bool:
        verdicts = (verdict for of in self.checks.values() for verdict in of)
        return any(verdict.status == "failed" and check in ("", verdict.check) for verdict in verdicts)


def plain(report: RunReport) -> str:
    return text_of(lambda console: _print(report, console))


def show(report: RunReport, console: Console) -> None:
    """Print a report, with colours on a terminal."""
    if console.is_terminal:
        _print(report, console)
    else:
        console.print(plain(report), end="", soft_wrap=True)


def _print(report: RunReport, console: Console) -> None:
    blocks: list[list[RenderableType]] = [
        [Text(f"FAILED  case {case}: {first_of(of)}", "bold red") for case, of in report.failures.items() if of],
        *_tables(report),
        [*_claims(report)],
        [_checks(case, verdicts) for case, verdicts in report.checks.items()],
    ]
    notes = [
        f"case {case}: {', '.join(names)} without an agent: MPSI, MQSI and the time to restore leave "
        f"{'it' if len(names) == 1 else 'them'} out; frequency and voltage do not"
        for case, names in report.findings.without_agent.items()
    ]
    blocks += [[Text.assemble(("NOTE", "yellow"), f"  {note}")] for note in (*notes, *report.notes)]
    blocks += [[Text.assemble("Results: ", (report.folder, "bold"))]] if report.folder else []
    for number, block in enumerate(filter(None, blocks)):
        if number:
            console.print()
        for line in block:
            console.print(line, soft_wrap=not isinstance(line, Table))


def _claims(report: RunReport) -> Iterator[Text]:
    """Yield a line for each claim, how many of them hold, and the distance from the publication."""
    width = max((len(verdict.claim.text) for verdict in report.verdicts), default=0)
    for verdict in report.verdicts:
        status = (f"{verdict.status:7}", _COLOURS[verdict.status])
        yield Text.assemble(status, f"  {verdict.claim.text:{width}}  ", (verdict.found, "dim"))
        if verdict.status == "MISS":
            yield Text(f"{'':7}  {verdict.claim.known_miss}", style="dim")
    if report.verdicts:
        of = Counter(verdict.status for verdict in report.verdicts)
        rest = f", {of['MISS']} missed for a known reason" if of["MISS"] else ""
        rest += f", {of['NOT RUN']} not run" if of["NOT RUN"] else ""
        yield Text(f"{of['PASS']} of {len(report.verdicts) - of['NOT RUN']} claims hold{rest}.")
        yield from map(Text, report.benchmark.lines(report.findings))


def _checks(case: str, verdicts: tuple[CheckVerdict, ...]) -> Text:
    failed = any(verdict.status == "failed" for verdict in verdicts)
    return Text.assemble(("CHECKS", "yellow" if failed else "green"), f"  case {case}: {summary(verdicts)}")


def _tables(report: RunReport) -> Iterator[list[RenderableType]]:
    """Yield our results as the paper's Tables I and II have them, with its numbers beside ours, and own metrics."""
    if any(report.findings.results.values()):  # without events there is no window to measure in
        yield _table_of(report, "Frequency and power sharing", ("f_error_Hz", "MPSI"))
        yield _table_of(report, "Voltage and var sharing", ("V_error", "MQSI"))
        if report.findings.own:
            yield _own_metrics(report)


def _rendered(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], legend: Sequence[str]
) -> list[RenderableType]:
    """Return a table whose first two columns name the rows; the lines below it say why a cell is no number."""
    table = Table(box=None, padding=(0, GAP, 0, 0))
    for number, column in enumerate(header):
        table.add_column(Text(column), justify="left" if number < 2 else "right")
    for row in rows:
        table.add_row(*(Text(cell, style="red" if cell.endswith("!") else "") for cell in row))
    return [Text(title, style="bold"), table, *(Text(line, style="dim") for line in legend)]


def _table_of(report: RunReport, title: str, quantities: tuple[Quantity, ...]) -> list[RenderableType]:
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
        legend.insert(0, "-: where there are several islands, each shares for itself; see its own row")
    header = ["event", "case", *(heading(quantity, found.f_nom) for quantity in quantities)]
    header += ["restored in"] if timed else []
    return _rendered(f"{title} after each event{against}", header, rows, legend)


def _places(found: Findings) -> Iterator[tuple[str, str, str, Steady]]:
    """Yield event, case, island ("" for all of it) and steady values of each row."""
    for event in dict.fromkeys(event for steady in found.results.values() for event in steady):
        for case in (case for case, steady in found.results.items() if event in steady):
            yield event, case, "", found.results[case][event]
            yield from ((event, case, island, values) for island, values in found.apart(case, event).items())


def _case(report: RunReport, case: str) -> str:
    return f"{case} {report.titles.get(case, '')}".strip()


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


def _own_metrics(report: RunReport) -> list[RenderableType]:
    own, rows, legend = report.findings.own, [], []
    names = dict.fromkeys(name for of in own.values() for measured in of.values() for name in measured.values)
    for event in dict.fromkeys(event for of in own.values() for event in of):
        for case, measured in ((case, of[event]) for case, of in own.items() if event in of):
            values = (measured.values.get(name) for name in names)
            rows.append([event, _case(report, case), *("-" if value is None else f"{value:.5g}" for value in values)])
            legend += [f"case {case}, {event}: {name} {text}" for name, text in measured.reasons.items()]
    return _rendered("Metrics of the scenario", ["event", "case", *names], rows, legend)
