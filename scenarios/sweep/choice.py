"""Which plots a table asks for: what is varied in it, and how."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from scenarios.results.history import Floats
from scenarios.sweep.statistics import MOST_VALUES, is_number
from scenarios.sweep.sweep_columns import FATE

REPEATS = ("sample", "case", "seed", "graph.number", "graph.lambda_2", "graph.edges")
"""Columns that repeat a point of the sweep instead of being an axis of it; medians are taken over them."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What is to be drawn."""

    columns: Mapping[str, Sequence[Any]]
    """The table."""
    cases: Sequence[str]
    """Its cases."""
    indexes: Mapping[str, Sequence[str]]
    """Indexes of each window."""
    alone: Sequence[str]
    """Parameters with a figure of their own."""
    map_of: tuple[str, str] | None
    """Two parameters with a heat map."""

    @property
    def runs(self) -> int:
        """Rows of the table."""
        return len(self.columns["case"])

    def is_number(self, name: str) -> bool:
        """Whether a parameter is a number in every row."""
        return is_number(self.columns[name])

    def rows(self, case: str) -> dict[str, list[Any]]:
        """Columns of the rows of a case."""
        mine = [i for i, name in enumerate(self.columns["case"]) if name == case]
        return {name: [column[i] for i in mine] for name, column in self.columns.items()}


def choose(table: pa.Table) -> Choice:
    """Choose by the number of parameters that have more than one value.

    One: by itself. Two numbers on a grid: a heat map. Else each by itself.
    """
    columns: dict[str, list[Any]] = table.to_pydict()
    names = list(columns)
    first = names.index(FATE[0])
    varied = [name for name in names[:first] if name not in REPEATS and len(set(columns[name])) > 1]
    indexes: dict[str, list[str]] = {}
    for name in (name for name in names[first:] if name not in FATE):
        window, _, index = name.rpartition(".")
        if window and not window.endswith(".p"):
            indexes.setdefault(window, []).append(index)
    gridded = len(varied) == 2 and all(_is_axis(columns[name]) for name in varied)
    return Choice(
        columns=columns,
        cases=list(dict.fromkeys(columns["case"])),
        indexes=indexes,
        alone=[] if gridded else varied,
        map_of=(varied[0], varied[1]) if gridded else None,
    )


def values(rows: Mapping[str, Sequence[Any]], column: str) -> Floats:
    """Values of an index: a time that never came is infinite, any other that is missing is not a number."""
    lacking = np.inf if column.rpartition(".")[2].startswith("t_") else np.nan
    return np.array([lacking if value is None else value for value in rows[column]], dtype=np.float64)


def _is_axis(column: Sequence[Any]) -> bool:
    return is_number(column) and len(set(column)) <= MOST_VALUES
