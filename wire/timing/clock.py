"""Ticks and run time: tick k is at t_k = k T_c."""

from __future__ import annotations

import math


def time_of(tick: int, T_c: float) -> float:
    """Return the run time (s) of a tick.

    It is a product and not a running sum, so every process computes the same bits for the same tick; it is rounded to
    the nanosecond, like the plant's rows.

    Examples
    --------
    >>> time_of(3, 0.02)
    0.06
    """
    return round(tick * T_c, 9)


def ticks_until(end: float, T_c: float) -> int:
    """Return the number of control periods T_c (s) from 0 to `end` (s), which must be a multiple of T_c.

    Examples
    --------
    >>> ticks_until(7.0, 0.02)
    350
    """
    if T_c <= 0.0:
        raise ValueError(f"T_c: the control period must be positive, got {T_c:g} s")
    ticks = round(end / T_c)
    if ticks < 1 or abs(ticks * T_c - end) > 1e-9 * max(1.0, end):
        raise ValueError(f"end: must be a positive multiple of the control period {T_c:g} s, got {end:g} s")
    return ticks


def rounded_up(t: float, T_c: float) -> float:
    """Return the first end (s) of a run at or after t (s): a whole number of control periods T_c (s), one at least.

    Examples
    --------
    >>> rounded_up(2.01, 0.02), rounded_up(2.02, 0.02), rounded_up(0.0, 0.02)
    (2.02, 2.02, 0.02)
    """
    return time_of(max(1, math.ceil(t / T_c - 1e-6)), T_c)
