"""A sum whose last digit is the same on every Python."""

from __future__ import annotations

from collections.abc import Iterable
from functools import reduce
from operator import add


def plain_sum(values: Iterable[float]) -> float:
    """Sum from left to right; `sum` compensates for rounding since Python 3.12, and would move histories."""
    return reduce(add, values, 0.0)
