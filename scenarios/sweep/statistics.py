"""Median and range of an index over the runs that share a parameter's value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarios.results.history import Floats

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
    """Median and range of values by their parameter.

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
        told = np.sort(values[part][~np.isnan(values[part])])
        came = told[np.isfinite(told)]
        lows.append(came[0] if came.size else np.nan)
        highs.append(came[-1] if came.size else np.nan)
        medians.append(_median(told))
        never.append(int(told.size - came.size))
    return Spread(x, np.array(lows), np.array(medians), np.array(highs), never, binned)


def is_number(column: Sequence[Any]) -> bool:
    """Whether a column holds numbers alone; what is true or false is none."""
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in column)


def _median(ordered: Floats) -> float:
    """Median of sorted values, some of which may be infinite: inf - inf must not come up."""
    if not ordered.size:
        return float("nan")
    low, high = float(ordered[(ordered.size - 1) // 2]), float(ordered[ordered.size // 2])
    return high if low == high or not np.isfinite(high) else (low + high) / 2.0
