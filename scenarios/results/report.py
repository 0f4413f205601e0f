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
    blocks: list[list[RenderableType]] = [
        [Text(f"FAILED  case {case}: {first_of(of)}", "bold red") for case, of in report.failures.items() if of],
        *([*_rendered(grid, min(console.width, _TABLE))] for grid in grids(report)),
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


def _grid(report: RunReport, title: str, quantities: tuple[Quantity, ...]) -> Grid:
    """Return a table of some quantities; what is shared means nothing over several islands, and is a dash there.

    A value that is not steady is no number: the first words of its reason stand there, and all of it below the table.
    """
    found = report.findings
    events = list(dict.fromkeys(event for steady in found.results.values() for event in steady))
    columns = [heading(quantity, found.f_nom) for quantity in quantities]
    columns += ["restored in"] if "f_error_Hz" in quantities else []
    header = ("case", *(f"{event}\n{column}" for event in events for column in columns))
    rows, legend = [], []
    for case in found.results:
        for island in ("", *dict.fromkeys(name for parts in found.islands.get(case, {}).values() for name in parts)):
            words = f"  island of {island}" if island else _case(report, case)
            cells = [cell for event in events for cell in _cells(report, case, event, island, quantities)]
            rows.append((words, *(text for text, _ in cells)))
            legend += [why for _, why in cells if why]
    beside = [one for one in report.benchmark.numbers if one.quantity in quantities and found.has(one)]
    sources = dict.fromkeys(one.source for one in beside)
    against = f", ours | paper's {' and '.join(sources)}" if sources else ""
    if any(found.islands.values()):
        legend.insert(0, "-: where there are several islands, each shares for itself; see its own row")
    return Grid(f"{title} after each event{against}", header, tuple(rows), "\n".join(legend))


def _case(report: RunReport, case: str) -> str:
    return f"{case} {report.titles.get(case, '')}".strip()


def _cells(
    report: RunReport, case: str, event: str, island: str, quantities: tuple[Quantity, ...]
) -> Iterator[tuple[str, str]]:
    """Yield the text of each cell of an event in a row, and for the legend why it is no number, or ""."""
    found, timed = report.findings, "f_error_Hz" in quantities
    islands = found.apart(case, event)
    values = islands.get(island) if island else found.results[case].get(event)
    if values is None:
        yield from [("", "")] * (len(quantities) + timed)
        return
    mixed = bool(islands) and not island
    where = f"{event}, island of {island}" if island else event
    for name in quantities:
        if mixed and name in SHARING:
            yield "-", ""
            continue
        why = f"case {case}, {where}: {_why(values, name, found.f_nom)}" if name in values.reasons else ""
        yield _cell(report, case, event, name, values, island), why
    if timed:
        restored = "never" if values.t_restore_s is None else f"{values.t_restore_s:.2f} s"
        yield "-" if mixed or _nothing_shared(values, "MPSI") else restored, ""


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
