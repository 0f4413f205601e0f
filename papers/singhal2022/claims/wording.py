"""How claims say what was found."""

from __future__ import annotations

import math
from collections.abc import Iterable


def ratio(before: float, after: float) -> float:
    """How many times smaller; nothing left is infinitely better."""
    return before / after if after else math.inf


def by_event(events: Iterable[str], values: Iterable[str]) -> str:
    """Words on several events."""
    return ", ".join(f"{event} {value}" for event, value in zip(events, values, strict=True))


def seconds(t: float | None) -> str:
    """Write a time that may never have come."""
    return "never" if t is None else f"{t:.2f} s"
