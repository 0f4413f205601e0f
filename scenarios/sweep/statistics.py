"""What the plots of a sweep show: the parameters that are varied, and median and range of an index over them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from scenarios.results.history import Floats
from scenarios.sweep.sweep_case import FATE

MOST_VALUES = 40
"""A number with more values than this was drawn at random, and is grouped."""


@dataclass(frozen=True)
class Spread:
    """An index over a parameter."""

    x: Sequence[Any]
    """Values of the parameter, in order; with `binned` the medians of its groups."""
    low: Floats
    """Least value of each."""
    median: Floats
    """Median; infinite where what is measured never came to be in half of the runs or more."""
    high: Floats
    """Greatest value that came to be."""
    never: Sequence[int]
    """In how many runs it never came to be."""
    binned: bool
    """Whether its values were grouped."""


def spread_of(at: Sequence[Any], values: Floats, bins: int) -> Spread:
    """Return the median and range of values by their parameter.

    Parameters
    ----------
    at : Sequence[Any]
        Value of the parameter of each run.
    values : Floats
        Index of each run: infinite where it never came to be, not a number where it says nothing.
    bins : int
        Groups for a parameter that was drawn at random.

    Examples
    --------
    >>> spread = spread_of([8, 8, 8, 12], np.array([3.0, 1.0, np.inf, 0.5]), 10)
    >>> spread.x, spread.median.tolist(), spread.high.tolist(), spread.never
    ([8, 12], [3.0, 0.5], [3.0, 0.5], [1, 0])
    """
    numeric = is_number(at)
    distinct = sorted(set(at)) if numeric else list(dict.fromkeys(at))
    binned = numeric and len(distinct) > MOST_VALUES
    if binned:
        order = np.argsort(np.asarray(at, float), kind="stable")
        groups = [part for part in np.array_split(order, bins) if part.size]
        x: list[Any] = [float(np.median(np.asarray(at, float)[part])) for part in groups]
    else:
        groups = [np.array([i for i, value in enumerate(at) if value == wanted]) for wanted in distinct]
        x = distinct
    lows, medians, highs, never = [], [], [], []
    for part in groups:
        known = values[part][~np.isnan(values[part])]
        came = known[np.isfinite(known)]
        lows.append(came.min() if came.size else np.nan)
        highs.append(came.max() if came.size else np.nan)
        medians.append(np.median(known) if known.size else np.nan)
        never.append(int(known.size - came.size))
    return Spread(x, np.array(lows), np.array(medians), np.array(highs), never, binned)


def is_number(column: Sequence[Any]) -> bool:
    """Return whether a column holds numbers alone; what is true or false is none."""
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in column)


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
        """Return whether a parameter is a number in every row."""
        return is_number(self.columns[name])

    def rows(self, case: str) -> dict[str, list[Any]]:
        """Return the columns of the rows of a case."""
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
    """Return the values of an index: a time that never came is infinite, any other that is missing is not a number."""
    lacking = np.inf if column.rpartition(".")[2].startswith("t_") else np.nan
    return np.array([lacking if value is None else value for value in rows[column]], dtype=np.float64)


def _is_axis(column: Sequence[Any]) -> bool:
    return is_number(column) and len(set(column)) <= MOST_VALUES
