"""Statistics for the plots of a sweep: which parameters vary, and median and range of an index over them."""

from __future__ import annotations

import numpy as np
import pandas as pd
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from gridpeers.scenarios.sweep.sweep_case import FATE

MOST_VALUES = 40
"""A number with more values than this was drawn at random, and is grouped."""

BINS = 12
"""Groups of equally many runs that a parameter drawn at random is cut into for its median."""

REPEATS = ("sample", "case", "seed", "graph.number", "graph.lambda_2", "graph.edges")
"""Columns that repeat a point of the sweep instead of being an axis of it; medians are taken over them."""


def is_number(column: pd.Series) -> bool:
    """Return whether a column holds numbers alone; truth values are none."""
    return bool(is_numeric_dtype(column) and not is_bool_dtype(column))


def is_drawn(column: pd.Series) -> bool:
    """Return whether a column holds numbers that were drawn at random."""
    return is_number(column) and column.nunique() > MOST_VALUES


def figures_of(frame: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return the parameters of each figure: two numbers on a grid share a heat map, all others stand by themselves."""
    varied = [name for name in _until_fate(frame) if name not in REPEATS and frame[name].nunique() > 1]
    if len(varied) == 2 and all(is_number(frame[name]) and not is_drawn(frame[name]) for name in varied):
        return [tuple(varied)]
    return [(name,) for name in varied]


def indexes_of(frame: pd.DataFrame) -> dict[str, list[str]]:
    """Return the indexes of each window, without the powers of single inverters."""
    found: dict[str, list[str]] = {}
    for name in list(frame)[len(_until_fate(frame)) :]:
        window, _, index = name.rpartition(".")
        if window and not window.endswith(".p"):
            found.setdefault(window, []).append(index)
    return found


def _until_fate(frame: pd.DataFrame) -> list[str]:
    columns = list(frame)
    return columns[: columns.index(FATE[0])]


def values_of(frame: pd.DataFrame, column: str) -> pd.Series:
    """Return the values of an index: a time that never came is infinite, any other that is missing is not a number."""
    index = column.rpartition(".")[2]
    return frame[column].astype(float).fillna(np.inf if index.startswith("t_") else np.nan)


def spread_of(at: pd.Series, values: pd.Series) -> pd.DataFrame:
    """Return `low`, `median` and `high` of values by their parameter, and how many `never` came to be.

    Parameters
    ----------
    at : Series
        Parameter of each run. One that was drawn at random is cut into groups, each with its median as index.
    values : Series
        Index of each run: infinite where it never came to be, not a number where it says nothing.

    Examples
    --------
    >>> spread_of(pd.Series([8, 8, 8, 12]), pd.Series([3.0, 1.0, np.inf, 0.5]))
        low  median  high  never
    8   1.0     3.0   3.0      1
    12  0.5     0.5   0.5      0
    """
    by = at.to_numpy()
    if is_drawn(at):
        groups = np.array_split(np.argsort(by, kind="stable"), BINS)
        by = pd.Series({run: np.median(by[group]) for group in groups for run in group}).sort_index().to_numpy()
    came = values.where(np.isfinite(values))
    columns = pd.DataFrame({"low": came, "median": values, "high": came, "never": np.isinf(values)})
    grouped = columns.groupby(by, sort=is_number(at))
    return grouped.agg({"low": "min", "median": "median", "high": "max", "never": "sum"})
