"""The end of a run for people: tables ours beside the paper's, a verdict per claim, where the results lie."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from scenarios.results.claims import Results, Verdict, within
from scenarios.results.paper_tables import COLUMNS, ISLANDING, Column

_COLOURS = {"PASS": "green", "FAIL": "bold red", "MISS": "yellow", "NOT RUN": "dim"}


@dataclass(frozen=True, kw_only=True)
class Report:
    """Everything that the end of a run tells."""

    scenario: str
    """Name."""
    titles: Mapping[str, str]
    """A few words on each case that was run."""
    results: Results
    """Steady values by case and event."""
    verdicts: Sequence[Verdict]
    """Claims judged; empty for a scenario of no experiment of the paper."""
    notes: Sequence[str]
    """What a reader must know besides, e.g. that an agent died."""
    folder: str
    """Where the results lie."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A table as text."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def grids(report: Report) -> tuple[Grid, ...]:
    """Tables I and II for our results, with the paper's numbers beside where there are any."""
    if not any(report.results.values()):
        return ()  # without events there is no window to measure in
    return tuple(_grid(report, table) for table in ("I", "II"))


def plain(report: Report) -> str:
    """Text of a report for files, pipes and logs."""
    blocks = [_plain_grid(grid) for grid in grids(report)]
    if report.verdicts:
        width = max(len(verdict.claim.text) for verdict in report.verdicts)
        lines = []
        for verdict in report.verdicts:
            lines.append(f"{verdict.status:7}  {verdict.claim.text:{width}}  {verdict.found}")
            lines += [f"{'':7}  {verdict.claim.known_miss}"] if verdict.status == "MISS" else []
        blocks.append("\n".join([*lines, _count(report.verdicts)]))
    blocks += [f"NOTE  {note}" for note in report.notes]
    blocks.append(f"Results: {report.folder}")
    return "\n\n".join(blocks) + "\n"


def show(report: Report, console: Console) -> None:
    """Print a report, with colours and rules on a terminal."""
    if not console.is_terminal:
        console.print(plain(report), end="", markup=False, highlight=False, soft_wrap=True)
        return
    for grid in grids(report):
        table = Table(title=grid.title, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
        for number, heading in enumerate(grid.header):
            table.add_column(escape(heading), justify="left" if number == 0 else "right", vertical="bottom")
        for row in grid.rows:
            table.add_row(*(f"[red]{escape(cell)}[/red]" if cell.endswith("!") else escape(cell) for cell in row))
        console.print(table)
        console.print()
    width = max((len(verdict.claim.text) for verdict in report.verdicts), default=0)
    for verdict in report.verdicts:
        colour = _COLOURS[verdict.status]
        text, found = escape(f"{verdict.claim.text:{width}}"), escape(verdict.found)
        console.print(f"[{colour}]{verdict.status:7}[/{colour}]  {text}  [dim]{found}[/dim]", highlight=False)
        if verdict.status == "MISS":
            console.print(f"{'':7}  [dim]{escape(verdict.claim.known_miss)}[/dim]", highlight=False)
    if report.verdicts:
        console.print(_count(report.verdicts), "\n", highlight=False)
    for note in report.notes:
        console.print(f"[yellow]NOTE[/yellow]  {escape(note)}", highlight=False)
    console.print(f"Results: [bold]{escape(report.folder)}[/bold]", highlight=False)


def _grid(report: Report, table: str) -> Grid:
    columns = [column for column in COLUMNS if column.table == table]
    events = list(dict.fromkeys(event for steady in report.results.values() for event in steady))
    judged = any(event in ISLANDING.get(case, {}) for case in report.results for event in events) and bool(
        report.verdicts
    )
    header = ["case"]
    for event in events:
        header += [f"{event}\n{column.heading}" for column in columns]
        header += [f"{event}\nrestored in"] if table == "I" else []
    rows = []
    for case, steady in report.results.items():
        row = [f"{case} {report.titles.get(case, '')}".strip()]
        for event in events:
            row += [_cell(column, case, event, getattr(steady[event], column.quantity), judged) for column in columns]
            if table == "I":
                t = steady[event].t_restore_s
                row.append("never" if t is None else f"{t:.2f} s")
        rows.append(tuple(row))
    against = f", ours | paper's Table {table}" if judged else ""
    title = "Frequency and power sharing" if table == "I" else "Voltage and var sharing"
    return Grid(title=f"{title} after each event{against}", header=tuple(header), rows=tuple(rows))


def _cell(column: Column, case: str, event: str, ours: float, judged: bool) -> str:
    """Write a number beside the paper's; one digit more than it prints, and "!" where it is not near enough."""
    text = f"{ours:.{column.digits + 1}f}"
    if not judged or event not in ISLANDING.get(case, {}):
        return text
    mark = " !" if within(column, case, event, ours) is False else ""
    return f"{text} | {ISLANDING[case][event][column.quantity]:.{column.digits}f}{mark}"


def _plain_grid(grid: Grid) -> str:
    upper, lower = zip(*((["", *heading.split("\n")])[-2:] for heading in grid.header), strict=True)
    table = [upper, lower, *grid.rows]
    widths = [max(len(row[i]) for row in table) for i in range(len(grid.header))]
    lines = [grid.title]
    for row in table:
        cells = (
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def _count(verdicts: Sequence[Verdict]) -> str:
    held = sum(verdict.status == "PASS" for verdict in verdicts)
    left = sum(verdict.status == "NOT RUN" for verdict in verdicts)
    missed = sum(verdict.status == "MISS" for verdict in verdicts)
    rest = f", {missed} missed for a known reason" if missed else ""
    rest += f", {left} not run" if left else ""
    return f"{held} of {len(verdicts) - left} claims hold{rest}."
