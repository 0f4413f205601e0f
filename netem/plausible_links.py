"""Which numbers make sense, and what was probably meant by one that does not.

A range is wide: it holds every value that somebody might want to try, and none that only a lost unit explains.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple


class Range(NamedTuple):
    """Numbers that make sense, bounds included."""

    what: str
    """What the number is, for the sentence."""
    unit: str
    """"s", "pu", "Hz", "1/s", any other, or ""."""
    low: float
    """Lowest value; with `above_zero` that of plausible ones, and zero and less is an error of its own."""
    high: float
    """Highest value."""
    above_zero: bool = False
    """Whether zero makes no sense at all."""


def objection(value: float, allowed: Range) -> str:
    """Why a number cannot be right, and what would be; empty when it can.

    Examples
    --------
    >>> period, power = Range("a control period", "s", 5e-4, 2.0, above_zero=True), Range("a power", "pu", 0.0, 1.2)
    >>> objection(20.0, period)
    '20 s is not plausible for a control period (0.0005 to 2 s); did you mean 0.02 (20 ms)?'
    >>> objection(-0.02, period)
    'a control period must be above 0, got -0.02 s; 0.0005 to 2 s makes sense'
    >>> objection(64.7, power)
    '64.7 pu is not plausible for a power (0 to 1.2 pu); did you mean 0.647 (64.7 %)?'
    >>> objection(-0.1, power)
    'a power must not be negative, got -0.1 pu; 0 to 1.2 pu makes sense'
    """
    unit = f" {allowed.unit}" if allowed.unit else ""
    span = f"{allowed.low:g} to {allowed.high:g}{unit}"
    try:
        value = float(value)  # a whole number may be beyond any float
    except OverflowError:
        value = math.inf if value > 0 else -math.inf
    if not math.isfinite(value):
        return f"{allowed.what} must be a finite number, got {value}; {span} makes sense"
    if allowed.above_zero and value <= 0:
        return f"{allowed.what} must be above 0, got {value:g}{unit}; {span} makes sense"
    if allowed.low == 0 and value < 0:
        return f"{allowed.what} must not be negative, got {value:g}{unit}; {span} makes sense"
    if allowed.low <= value <= allowed.high:
        return ""
    return f"{value:g}{unit} is not plausible for {allowed.what} ({span}){_meant(value, allowed)}"


def number_in(text: str) -> str:
    """What to write instead of a text with a unit, or "" when it is not one.

    Examples
    --------
    >>> number_in("20 ms"), number_in("64.7%"), number_in("soon")
    ('; write 0.02', '; write 0.647', '')
    """
    match = re.fullmatch(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(us|ms|s|%|pu|Hz|mHz)?\s*", text)
    if match is None:
        return ""
    factor = {"us": 1e-6, "ms": 1e-3, "%": 1e-2, "mHz": 1e-3}.get(match[2] or "", 1.0)
    return f"; write {float(match[1]) * factor:g}"


def _meant(value: float, allowed: Range) -> str:
    factor, name = {"s": (1000.0, "ms"), "pu": (100.0, "%"), "Hz": (1000.0, "mHz")}.get(allowed.unit, (1.0, ""))
    if name and allowed.low <= value / factor <= allowed.high:
        return f"; did you mean {value / factor:g} ({value:g} {name})?"
    if allowed.unit == "pu" and abs(value) > 100:
        return "; it is per unit of the inverter's own rating, neither kW nor V"
    return ""
