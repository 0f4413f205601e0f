"""The claims of one experiment: decorated functions, and columns of the paper's tables that our numbers must meet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from gridpeers import Claim, Findings, Judge
from gridpeers.measures import UNITS, Quantity, label
from gridpeers.papers.singhal2022.tables import TABLE, V_RELATIVE, Cell, TableNumber, tables_of


class ExperimentClaims:
    """Claims of one experiment, named as in the scenario's key `paper`, in the order of their definitions.

    `shared` are fields of `gridpeers.Claim` that all the decorated claims have.
    """

    def __init__(self, experiment: str, **shared: Any) -> None:
        self._columns = {
            (table.number, quantity): tuple(cell for cell in table.cells if cell.quantity == quantity)
            for table in tables_of(experiment)
            for quantity in table.quantities
        }
        self._shared = {"measures": ()} | shared
        self.all: tuple[Claim, ...] = ()
        """All claims, in order."""

    def add(self, text: str, **fields: Any) -> Callable[[Judge], Judge]:
        """Add a claim that the decorated function judges; its name is the function's."""

        def added(judge: Judge) -> Judge:
            self.all += (Claim(**{"name": judge.__name__} | self._shared | fields, text=text, judge=judge),)
            return judge

        return added

    def column(self, number: TableNumber, quantity: Quantity) -> None:
        """Add the claim that all numbers of a column of a table are within its tolerance."""
        bound = f"{TABLE[number, quantity].value:g}{UNITS[quantity]} of Table {number}"
        self._near(number, quantity, "", bound, Cell.within)

    def relative(self, number: TableNumber, known_miss: str = "") -> None:
        """Add the claim that all V_error of a table are near the paper's, in proportion to their size."""
        bound = f"{100 * V_RELATIVE:g} % of Table {number}'s"
        self._near(number, "V_error", "_relative", bound, Cell.within_relative, known_miss)

    def _near(
        self,
        number: TableNumber,
        quantity: Quantity,
        suffix: str,
        bound: str,
        within: Callable[[Cell, float], bool | None],
        known_miss: str = "",
    ) -> None:
        cells = self._columns[number, quantity]

        def lacking(found: Findings) -> str:
            absent = [cell for cell in cells if not found.has(cell)]
            return f"this number is missing: {absent[0].where}" if absent else ""

        def judge(found: Findings) -> tuple[bool, str]:
            off = {cell: abs(found.value(cell) - cell.paper) for cell in cells}
            worst = max(cells, key=lambda cell: math.inf if math.isnan(off[cell]) else off[cell])
            near = sum(bool(within(cell, found.value(cell))) for cell in cells)
            some = f"{near} of {len(cells)}, " if near < len(cells) else ""
            return near == len(cells), f"{some}largest difference {off[worst]:.4f}{UNITS[quantity]} ({worst.where})"

        claim = Claim(
            name=f"table_{number}_{quantity}{suffix}",
            text=f"all {_WORDS[len(cells)]} {label(quantity)} within {bound}",
            source=f"Table {number}",
            cases=tuple(dict.fromkeys(cell.case for cell in cells)),
            events=tuple(dict.fromkeys(cell.event for cell in cells)),
            judge=judge,
            measures=(quantity,),
            lacking=lacking,
            known_miss=known_miss,
        )
        self.all += (claim,)


_WORDS = {3: "three", 5: "five", 8: "eight"}


def ratio(before: float, after: float) -> float:
    """Return how many times smaller `after` is; a zero is infinitely smaller."""
    return before / after if after else math.inf


def listed(values: Iterable[tuple[str, str]]) -> str:
    """Return names with their values, e.g. "event1 0.12, event2 0.30"."""
    return ", ".join(f"{name} {value}" for name, value in values)


def seconds(t: float | None) -> str:
    """Write a time, or "never"."""
    return "never" if t is None else f"{t:.2f} s"
