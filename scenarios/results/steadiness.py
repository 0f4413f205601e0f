"""Steadiness of the values at the end of a window, and the reason where they are not steady.

A measure counts as steady when its mean over the last 0.2 s of the window differs from its mean over the 0.2 s before
by no more than one unit of the last digit that the paper prints: 0.01 Hz, 0.01 (MPSI, MQSI), 0.001 pu (V_error), and
0.01 pu for powers. So it moves by less than 0.05 Hz/s, 0.05 1/s, 0.005 pu/s, 0.05 pu/s. Above 0.2, where the paper's
MQSI has values up to 2, 5 % of MQSI do. Within the last 0.2 s it may swing by five times as much: a ripple averages
out, a limit cycle does not count. A window of less than 0.4 s is halved instead.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.scenarios.results.metric import DIGITS, UNITS, Measure

STEADY = 0.2
"""Length of the end of a window over which steady values are means (s); 12 periods of 60 Hz, ten control periods."""

SWINGS = 5.0  # Factor by which a measure may swing more within `STEADY` than its mean may move
FEWEST = 2  # Rows that each of the two means needs at least


PARTS: Mapping[str, float] = {"MQSI": 0.05}
"""Part of its value by which a measure may move, where that is more than a unit of its last digit."""


class Ends(NamedTuple):
    """Rows at the end of a window."""

    start: float
    end: float
    """Of the window (s)."""
    apart: float
    """Time (s) between the middles of the last two parts."""
    last: Flags
    before: Flags
    """Rows of the part before it."""
    steady: Flags
    """Rows over which steady values are means: the last `STEADY`."""


def ends_of(t: Floats, start: float, end: float) -> Ends:
    """Return the rows at the end of a window that lasts from start to end (s) and has rows at the times t (s) alone."""
    span = min(STEADY, 0.5 * (end - start))
    last = t >= end - span - 1e-9
    before = ~last & (t >= end - 2.0 * span - 1e-9)
    apart = float(t[last].mean() - t[before].mean()) if last.any() and before.any() else span
    return Ends(start, end, apart, last, before, t >= end - STEADY - 1e-9)


def reason(measure: Measure, x: Floats, ends: Ends, missing: str, names: tuple[str, ...] = ()) -> str:
    """Return why a measure has no steady value; "" where it has.

    Its rows x, shape (T,), or (T, M) for the inverters of these names, are not numbers where it has no value: `missing`
    says why, as "de-energised: no inverter is on the network".
    """
    if not ends.steady.any():
        return f"no samples: no row was recorded between {ends.start:g} s and {ends.end:g} s"
    columns = x.reshape(len(x), -1)
    valid = np.isfinite(columns[ends.steady])
    if not valid.any(axis=1).any():
        return missing
    if not valid.any(axis=1).all():
        return f"{missing} in a part of the last {STEADY:g} s"
    if min(ends.last.sum(), ends.before.sum()) < FEWEST:
        return f"not steady: {_rows(len(x), ends.end - ends.start)} too few to tell"
    unit, reasons = UNITS[measure], []
    for i, column in enumerate(columns.T):
        recent, earlier = column[ends.last], column[ends.before]
        recent, earlier = recent[np.isfinite(recent)], earlier[np.isfinite(earlier)]
        if not recent.size:
            continue
        of = f"{names[i]} " if names else ""
        part = PARTS.get(measure, 0.0) * abs(float(recent.mean()))
        allowed, swing = max(10.0 ** -DIGITS[measure], part), float(np.ptp(recent))
        change = float(recent.mean() - earlier.mean()) if earlier.size else 0.0
        if abs(change) * STEADY > allowed * ends.apart * (1.0 + 1e-9):
            per = f"{unit.strip() or '1'}/s"
            reasons.append((abs(change) / allowed, f"not steady: {of}still moves {change / ends.apart:+.2g} {per}"))
        elif swing > SWINGS * allowed:
            reasons.append((swing / allowed / SWINGS, f"not steady: {of}still swings by {swing:.2g}{unit}"))
    return max(reasons, default=(0.0, ""))[1]


def _rows(count: int, length: float) -> str:
    return f"1 row ({length:.3g} s) is" if count == 1 else f"{count} rows ({length:.3g} s) are"
