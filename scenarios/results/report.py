"""The report at the end of a run: tables with our numbers beside the paper's, a verdict per claim, the folder."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

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


class Grid(NamedTuple):
    """A table as text; the first column names the rows, the first line of each other header its event."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    legend: str = ""
    """Lines below it; may be empty."""


def folded(grid: Grid, width: int) -> Iterator[Grid]:
    """Yield a table in parts that are at most so wide (characters), one below the other; no event is torn apart.

    Each part begins with the first column and has the rows that say something in it. An event that is wider has a part
    of its own.
    """
    widths = [
        GAP + max(len(line) for cell in column for line in cell.split("\n"))
        for column in zip(grid.header, *grid.rows, strict=True)
    ]
    parts: list[list[int]] = []
    events: dict[str, list[int]] = {}  # a metric that only a later case has comes last in the header
    for i, text in enumerate(grid.header[1:], 1):
        events.setdefault(text.partition("\n")[0], []).append(i)
    for columns in events.values():
        if parts and sum(widths[i] for i in (0, *parts[-1], *columns)) <= width:
            parts[-1] += columns
        else:
            parts.append(columns)
    for columns in parts:
        rows = (row for row in grid.rows if len(parts) == 1 or any(row[i] for i in columns))
        header, *cells = (tuple(row[i] for i in (0, *columns)) for row in (grid.header, *rows))
        yield Grid("", header, tuple(cells))


_TABLE = 140  # Characters of a table in a file: with four events it would have 200 and more

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


def grids(report: RunReport) -> tuple[Grid, ...]:
    """Return the tables of our results, laid out as the paper's Tables I and II, with its numbers beside ours."""
    if not any(report.findings.results.values()):
        return ()  # without events there is no window to measure in
    tables = (
        _grid(report, "Frequency and power sharing", ("f_error_Hz", "MPSI")),
        _grid(report, "Voltage and var sharing", ("V_error", "MQSI")),
    )
    return (*tables, _own_grid(report)) if report.findings.own else tables


def plain(report: RunReport) -> str:
    return text_of(lambda console: _print(report, console))


def show(report: RunReport, console: Console) -> None:
    """Print a report, with colours on a terminal."""
    if console.is_terminal:
        _print(report, console)
    else:
        console.print(plain(report), end="", soft_wrap=True)


def _print(report: RunReport, console: Console) -> None:
    failed: list[RenderableType] = [
        Text(f"FAILED  case {case}: {first_of(of)}", "bold red") for case, of in report.failures.items() if of
    ]
    blocks = [failed] if failed else []
    blocks += [[*_rendered(grid, min(console.width, _TABLE))] for grid in grids(report)]
    if report.verdicts:
        width = max(len(verdict.claim.text) for verdict in report.verdicts)
        lines: list[RenderableType] = []
        for verdict in report.verdicts:
            status = (f"{verdict.status:7}", _COLOURS[verdict.status])
            lines.append(Text.assemble(status, f"  {verdict.claim.text:{width}}  ", (verdict.found, "dim")))
            if verdict.status == "MISS":
                lines.append(Text(f"{'':7}  {verdict.claim.known_miss}", style="dim"))
        blocks.append([*lines, _count(report.verdicts), *report.benchmark.lines(report.findings)])
    if report.checks:
        blocks.append([_verdict_of(case, verdicts) for case, verdicts in report.checks.items()])
    blocks += [[Text.assemble(("NOTE", "yellow"), f"  {note}")] for note in _all_notes(report)]
    blocks += [[Text.assemble("Results: ", (report.folder, "bold"))]] if report.folder else []
    for number, block in enumerate(blocks):
        if number:
            console.print()
        for line in block:
            console.print(line, soft_wrap=not isinstance(line, Table))


def _verdict_of(case: str, verdicts: tuple[CheckVerdict, ...]) -> Text:
    failed = any(verdict.status == "failed" for verdict in verdicts)
    return Text.assemble(("CHECKS", "yellow" if failed else "green"), f"  case {case}: {summary(verdicts)}")


def _rendered(grid: Grid, width: int) -> Iterator[RenderableType]:
    yield Text(grid.title, style="bold")
    for part in folded(grid, width):
        table = Table(box=None, padding=(0, GAP, 0, 0))
        for number, column in enumerate(part.header):
            table.add_column(Text(column), justify="left" if number == 0 else "right", vertical="bottom")
        for row in part.rows:
            table.add_row(*(Text(cell, style="red" if cell.endswith("!") else "") for cell in row))
        yield table
    if grid.legend:
        yield Text(grid.legend, style="dim")


def _all_notes(report: RunReport) -> list[str]:
    agentless = [
        f"case {case}: {', '.join(names)} without an agent: MPSI, MQSI and the time to restore leave "
        f"{'it' if len(names) == 1 else 'them'} out; frequency and voltage do not"
        for case, names in report.findings.without_agent.items()
    ]
    return [*agentless, *report.notes]


def _grid(report: RunReport, title: str, quantities: tuple[Quantity, ...]) -> Grid:
    findings = report.findings
    events = list(dict.fromkeys(event for steady in findings.results.values() for event in steady))
    header, rows = ["case"], []
    for event in events:
        header += [f"{event}\n{heading(quantity, findings.f_nom)}" for quantity in quantities]
        header += [f"{event}\nrestored in"] if "f_error_Hz" in quantities else []
    for case in findings.results:
        islands = dict.fromkeys(name for parts in findings.islands.get(case, {}).values() for name in parts)
        for island in ("", *islands):
            words = f"  island of {island}" if island else _case(report, case)
            cells = (cell for event in events for cell in _cells(report, case, event, island, quantities))
            rows.append((words, *cells))
    beside = [one for one in report.benchmark.numbers if one.quantity in quantities and findings.has(one)]
    sources = dict.fromkeys(one.source for one in beside)
    against = f", ours | paper's {' and '.join(sources)}" if sources else ""
    legend = list(_reasons(report, quantities))
    if any(findings.islands.values()):
        legend.insert(0, "-: where there are several islands, each shares for itself; see its own row")
    return Grid(f"{title} after each event{against}", tuple(header), tuple(rows), "\n".join(legend))


def _case(report: RunReport, case: str) -> str:
    return f"{case} {report.titles.get(case, '')}".strip()


def _own_grid(report: RunReport) -> Grid:
    own = report.findings.own
    places = dict.fromkeys((event, name) for of in own.values() for event in of for name in of[event].values)
    rows, reasons = [], []
    for case, of in own.items():
        values = [of[event].values.get(name) if event in of else None for event, name in places]
        rows.append((_case(report, case), *("-" if value is None else f"{value:.5g}" for value in values)))
        reasons += [f"case {case}, {event}: {name} {text}" for event in of for name, text in of[event].reasons.items()]
    header = ("case", *(f"{event}\n{name}" for event, name in places))
    return Grid("Metrics of the scenario", header, tuple(rows), "\n".join(reasons))


def _cells(report: RunReport, case: str, event: str, island: str, quantities: tuple[Quantity, ...]) -> Iterator[str]:
    """Yield the cells of an event in a row; one that means nothing over several islands is a dash."""
    islands, timed = report.findings.apart(case, event), "f_error_Hz" in quantities
    values = islands.get(island) if island else report.findings.results[case].get(event)
    if values is None:
        yield from [""] * (len(quantities) + timed)
        return
    mixed = bool(islands) and not island
    for name in quantities:
        yield "-" if mixed and name in SHARING else _cell(report, case, event, name, values, island)
    if timed:
        restored = "never" if values.t_restore_s is None else f"{values.t_restore_s:.2f} s"
        yield "-" if mixed or _nothing_shared(values, "MPSI") else restored


def _nothing_shared(values: Steady, name: str) -> bool:
    """Return True if there is too little power for a sharing index to mean anything."""
    return values.reasons.get(name, "").startswith("nothing shared")


def _cell(report: RunReport, case: str, event: str, quantity: Quantity, values: Steady, island: str) -> str:
    """Write a number beside the paper's; one digit more than it prints, and "!" where it is not near enough.

    A value that is not steady is no number: the first words of its reason stand there, and all of it below the table.
    """
    paper = report.benchmark.number(case, event, quantity, island)
    ours, reason = getattr(values, quantity), values.reasons.get(quantity, "")
    text = reason.partition(":")[0] or f"{ours:.{(paper.digits if paper else DIGITS[quantity]) + 1}f}"
    if paper is None:
        return text
    return f"{text} | {paper.paper:.{paper.digits}f}{' !' if report.findings.within(paper) is False else ''}"


def _reasons(report: RunReport, quantities: tuple[Quantity, ...]) -> Iterator[str]:
    """Yield a line for every number that is not shown, with the mean of the last 0.2 s."""
    findings = report.findings
    for case, steady in findings.results.items():
        for event in steady:
            for where, values in findings.parts(case, event).items():
                mixed = bool(findings.apart(case, event)) and not where
                for name in quantities:
                    if name not in values.reasons or (mixed and name in SHARING):
                        continue
                    mean, measure = getattr(values, name), label(name, findings.f_nom)
                    dust = math.isnan(mean) or _nothing_shared(values, name)
                    last = "" if dust else f" (mean of the last {STEADY:g} s: {mean:.3f}{UNITS[name]})"
                    yield f"case {case}, {event}{where}: {measure} {values.reasons[name]}{last}"


def _count(verdicts: Sequence[Verdict]) -> str:
    of = Counter(verdict.status for verdict in verdicts)
    rest = f", {of['MISS']} missed for a known reason" if of["MISS"] else ""
    rest += f", {of['NOT RUN']} not run" if of["NOT RUN"] else ""
    return f"{of['PASS']} of {len(verdicts) - of['NOT RUN']} claims hold{rest}."
