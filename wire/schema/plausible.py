"""Units and ranges of numbers as annotations of a field, and what was probably meant by a number out of range. Pure.

    T_c_s: Annotated[float, Unit("s"), Plausible("a control period", 0.0005, 2.0, above_zero=True)] = 0.02

`Range` bounds the values that code can use. `Plausible` bounds what makes sense: wide enough for every value that
somebody might want to try, and too narrow for one that only a lost unit explains.

An `objection` is the end of a sentence that says why a value cannot be right, or "".
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from gridpeers.wire.wording import printable


@dataclass(frozen=True)
class Unit:
    """Unit of a number, e.g. `Unit("1/s")`; without one it is a pure number or no number."""

    text: str
    in_key: bool = True
    """Whether the key of a file ends in the unit, where the unit can be a part of a key."""


@dataclass(frozen=True)
class Range:
    """Least and greatest value of a parameter, both allowed."""

    low: float = -math.inf
    high: float = math.inf

    @property
    def span(self) -> str:
        low, high = (str(bound) if isinstance(bound, int) else f"{bound:g}" for bound in (self.low, self.high))
        if math.isfinite(self.low):
            return f"{low} to {high}" if math.isfinite(self.high) else f"at least {low}"
        return f"at most {high}" if math.isfinite(self.high) else ""

    def objection(self, value: Any, unit: str = "") -> str:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            return f"must be a number, got {printable(str(value), 60)}"
        if not math.isfinite(value):
            return f"must be a finite number, got {value:g}"
        if self.low <= value <= self.high:
            return ""
        bounds = f"from {self.span}" if " to " in self.span else self.span
        return f"must be {bounds}{f' {unit}' if unit else ''}, got {value:g}"


@dataclass(frozen=True)
class Plausible:
    """Numbers that make sense, bounds included."""

    what: str
    """Name of the quantity, with its article: the subject of the sentence."""
    low: float
    """Lowest value; with `above_zero` that of plausible ones, and zero and less is an error of its own."""
    high: float
    above_zero: bool = False
    hint: str | Callable[[float], str] = ""
    """End of the sentence about a value that is not plausible, or a function from the value to it."""

    @property
    def span(self) -> str:
        return f"{self.low:g} to {self.high:g}"

    def objection(self, value: float, unit: str = "") -> str:
        """Return why a number cannot be right and what would be.

        Examples
        --------
        >>> Plausible("a control period", 5e-4, 2.0, above_zero=True).objection(20.0, "s")
        '20 s is not plausible for a control period (0.0005 to 2 s); did you mean 0.02 (20 ms)?'
        """
        if abs(value) > 1e300:  # a whole number may be beyond any float
            value = math.inf if value > 0 else -math.inf
        text = f" {unit}" if unit else ""
        hint = self.hint if isinstance(self.hint, str) else self.hint(value)
        rule = ""
        if not math.isfinite(value):
            rule, text = "be a finite number", ""
        elif self.above_zero and value <= 0:
            rule = "be above 0"
        elif self.low == 0 and value < 0:
            rule = "not be negative"
        span = f"{self.span} {unit}" if unit else self.span
        if rule:
            return f"{self.what} must {rule}, got {value:g}{text}; {span} makes sense{hint}"
        if self.low <= value <= self.high:
            return ""
        return f"{value:g}{text} is not plausible for {self.what} ({span}){self._meant(value, unit) or hint}"

    def _meant(self, value: float, unit: str) -> str:
        for factor, other in _OTHER_UNITS.get(unit, ()):
            if self.low <= value * factor <= self.high:
                return f"; did you mean {value * factor:g} ({value:g} {other})?"
        return "; it is per unit of the rating, neither kW nor V" if unit == "pu" and abs(value) > 100 else ""


@dataclass(frozen=True)
class Probability:
    what: str
    """Name of the event."""
    above_zero: bool = False
    """Whether 0, and all below 1e-12, is an error: the probability divides another number."""

    @property
    def span(self) -> str:
        return "above 0, to 1" if self.above_zero else "0 to 1"

    def objection(self, value: float, unit: str = "") -> str:
        if (1e-12 if self.above_zero else 0.0) <= value <= 1.0:
            return ""
        bounds = "above 0 and up to 1" if self.above_zero else "from 0 to 1"
        return f"{self.what} is a probability {bounds}, got {value:g}{in_percent(value)}"


def in_percent(value: float) -> str:
    """Return the end of a sentence about a number from 0 to 1 that was written in percent, "" if it was not."""
    return f"; did you mean {value / 100.0:g} ({value:g} %)?" if 1.0 < value <= 100.0 else ""


_OTHER_UNITS: dict[str, tuple[tuple[float, str], ...]] = {
    "s": ((1e-3, "ms"),),
    "kW": ((1e-3, "W"), (1e3, "MW")),
    "kvar": ((1e-3, "var"), (1e3, "Mvar")),
    "kVA": ((1e-3, "VA"), (1e3, "MVA")),
    "kV": ((1e-3, "V"),),
    "m": ((1e3, "km"), (1e-3, "mm")),
    "Hz": ((1e-3, "mHz"), (1e3, "kHz")),
    "ohm/km": ((1e-3, "ohm/1000 km"), (1e3, "ohm/m")),
    "pu": ((1e-2, "%"),),
    "%": ((1e2, "pu"),),
}
"""By unit: factors that turn a number written in another unit into it."""


def number_in(text: str) -> str:
    """Return the end of a sentence that says what to write instead of a text with a unit, "" if it is none.

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
