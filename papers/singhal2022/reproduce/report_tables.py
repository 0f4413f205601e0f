"""A table of the paper as rows of text: the paper's number, ours, and the difference with its verdict."""

from __future__ import annotations

from typing import NamedTuple

from gridpeers.benchmarks import HEADINGS, Quantity
from gridpeers.papers.singhal2022.reproduce.reproduction import PartResult
from gridpeers.papers.singhal2022.tables import Cell, PaperTable
from gridpeers.papers.singhal2022.tolerances import MQSI_FACTOR, V_RELATIVE


class Entry(NamedTuple):
    """One number beside the paper's."""

    paper: str
    ours: str
    """With a digit more than the paper prints."""
    off: str
    """Ours less the paper's."""
    judged: tuple[tuple[str, bool], ...]
    """Every judgement: its measure, "" for the tolerance of its table, and whether it passes."""


class GridRow(NamedTuple):
    """One row: a case (or an island) after one event."""

    label: str
    entries: tuple[Entry, ...]


def lines(table: PaperTable, result: PartResult) -> tuple[GridRow, ...]:
    """Return the rows of a table, in the paper's order."""
    rows: dict[str, dict[Quantity, Cell]] = {}
    titles = titles_of(result)
    several = len({cell.event for cell in table.cells}) > 1
    for cell in table.cells:
        what = f"island of {cell.island}" if cell.island else titles.get(cell.case, cell.case)
        rows.setdefault(f"{what}, {cell.event}" if several else what, {})[cell.quantity] = cell
    return tuple(
        GridRow(label, tuple(_entry(cells[quantity], result) for quantity in table.quantities))
        for label, cells in rows.items()
    )


def titles_of(result: PartResult) -> dict[str, str]:
    """Return the case names for people."""
    words = {"I": "no control", "II": "un-coordinated", "III": "GFM-coordinated", "IV": "fully coordinated"}
    return {case: f"{case} {words[case]}" if case in words else case for case in result.found.results}


def tolerances(table: PaperTable) -> list[str]:
    """Return the tolerance of each column, and its reason."""
    found = []
    for quantity in table.quantities:
        cell = next(cell for cell in table.cells if cell.quantity == quantity)
        value = cell.tolerance.value
        bound = f"compared by a factor of {MQSI_FACTOR.value:g} only" if value is None else f"within {value:g}"
        found.append(f"{HEADINGS[quantity]}: {bound}; {cell.tolerance.reason}")
        if cell.relative is not None:
            found.append(f"{HEADINGS[quantity]}, beside its own size: {100 * V_RELATIVE.value:g} % {V_RELATIVE.reason}")
    return found


def _entry(cell: Cell, result: PartResult) -> Entry:
    ours, reason = result.found.value(cell), result.found.reason(cell)
    digits, paper = cell.digits + 1, f"{cell.paper:.{cell.digits}f}"
    if reason:
        return Entry(paper, reason.partition(":")[0], "-", _judged(cell, float("nan")))
    off = round(ours - cell.paper, digits) + 0.0  # no "-0.000"
    times = f" ({ours / cell.paper:.2g} times)" if cell.tolerance.value is None else ""
    return Entry(paper, f"{ours:.{digits}f}", f"{off:+.{digits}f}{times}", _judged(cell, ours))


def _judged(cell: Cell, ours: float) -> tuple[tuple[str, bool], ...]:
    by = {
        "": cell.within(ours),
        f"{100 * V_RELATIVE.value:g} %": cell.within_relative(ours),
        f"factor {MQSI_FACTOR.value:g}": cell.within_factor(ours),
    }
    return tuple((name, holds) for name, holds in by.items() if holds is not None)
