"""A length of time in words."""

from __future__ import annotations

import math

_UNITS = ((120, 1, "s"), (7200, 60, "min"), (172_800, 3600, "h"), (math.inf, 86_400, "days"))
"""Below which length (s) which unit (s) is used, and its name."""


def duration(seconds: float) -> str:
    """A length of time (s) in words, of two digits: more would promise too much.

    Examples
    --------
    >>> duration(45), duration(112), duration(600), duration(20_000), duration(400_000)
    ('45 s', '110 s', '10 min', '5.6 h', '4.6 days')
    """
    unit, name = next((unit, name) for bound, unit, name in _UNITS if seconds < bound)
    return f"{float(f'{seconds / unit:.2g}'):g} {name}"
