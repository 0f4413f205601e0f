"""Claims that a column of a table is met."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from gridpeers.benchmarks import UNITS, Claim, Findings, Quantity, label
from papers.singhal2022.tables import Cell, tables_of
from papers.singhal2022.tolerances import V_RELATIVE, TableNumber


def near_the_table(experiment: str, number: TableNumber, quantity: Quantity) -> Claim:
    """Return the claim that all numbers of one column of a table are near the paper's."""
    cells = _column(experiment, number, quantity)
    tolerance = cells[0].tolerance.value
    return _near(
        f"table_{number}_{quantity}",
        f"all {_WORDS.get(len(cells), str(len(cells)))} {label(quantity)} within {tolerance:g}{UNITS[quantity]} of "
        f"Table {number}",
        cells,
        Cell.within,
    )


def near_relatively(experiment: str, number: TableNumber, known_miss: str = "") -> Claim:
    """Return the claim that all V_error of a table are near the paper's beside their own size."""
    cells = _column(experiment, number, "V_error")
    text = (
        f"all {_WORDS.get(len(cells), str(len(cells)))} V_error within {100 * V_RELATIVE.value:g} % of Table {number}'s"
    )
    return _near(f"table_{number}_V_error_relative", text, cells, Cell.within_relative, known_miss)


def _column(experiment: str, number: TableNumber, quantity: Quantity) -> tuple[Cell, ...]:
    table = next(table for table in tables_of(experiment) if table.number == number)
    return tuple(cell for cell in table.cells if cell.quantity == quantity)


def _near(
    name: str, text: str, cells: Sequence[Cell], within: Callable[[Cell, float], bool | None], known_miss: str = ""
) -> Claim:
    """Return the claim that all our numbers pass a judgement beside the paper's."""
    unit = UNITS[cells[0].quantity]

    def lacking(found: Findings) -> str:
        absent = [cell for cell in cells if not found.has(cell)]
        return f"there is no such number: {absent[0].where}" if absent else ""

    def compare(found: Findings) -> tuple[bool, str]:
        ours = {cell: found.value(cell) for cell in cells}

        def off(cell: Cell) -> float:
            difference = abs(ours[cell] - cell.paper)
            return math.inf if math.isnan(difference) else difference

        worst = max(cells, key=off)
        failing = [cell for cell in cells if not within(cell, ours[cell])]
        some = f"{len(cells) - len(failing)} of {len(cells)}, " if failing else ""
        return not failing, f"{some}at most off by {abs(ours[worst] - worst.paper):.4f}{unit} ({worst.where})"

    return Claim(
        name=name,
        text=text,
        source=f"Table {cells[0].table}",
        cases=tuple(dict.fromkeys(cell.case for cell in cells)),
        events=tuple(dict.fromkeys(cell.event for cell in cells)),
        judge=compare,
        measures=(cells[0].quantity,),
        lacking=lacking,
        known_miss=known_miss,
    )


_WORDS = {3: "three", 5: "five", 8: "eight"}


def ratio(before: float, after: float) -> float:
    """Return how many times smaller; nothing left is infinitely better."""
    return before / after if after else math.inf


def by_event(events: Iterable[str], values: Iterable[str]) -> str:
    """Return words on several events."""
    return ", ".join(f"{event} {value}" for event, value in zip(events, values, strict=True))


def seconds(t: float | None) -> str:
    """Write a time that may never have come."""
    return "never" if t is None else f"{t:.2f} s"
