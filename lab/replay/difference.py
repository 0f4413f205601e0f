"""The first difference between what was recorded and what a replay gives."""

from __future__ import annotations

from collections.abc import Iterator
from math import isnan
from typing import Any, NamedTuple

from gridpeers.scenarios.results.record import QUANTITIES
from gridpeers.wire.messages import AnyMessage, Measurement

TOLERANCE = 1e-9
"""Largest difference of two numbers that count as the same, in their units: set-points in W and V."""

UNITS = {"P": "W", "Q": "var", "V": "V", "f": "Hz", "P_set": "W", "V_set": "V", "t": "s"}
"""Units of the fields of measurements and states."""


class Difference(NamedTuple):
    """Two values that are not the same."""

    name: str
    """The agent or inverter."""
    t: float
    """Run time (s)."""
    quantity: str
    """What differs."""
    recorded: Any
    """Its value in the record."""
    replayed: Any
    """Its value in the replay."""
    unit: str = ""
    """Unit of both; "" if they have none."""

    def __str__(self) -> str:
        """Return it as a sentence.

        Examples
        --------
        >>> print(Difference("inv4", 4.3, "P_set", 291900.0, 291850.5, "W"))
        inv4 at t = 4.30 s: P_set is 291900.0 W in the record and 291850.5 W in the replay
        """
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{self.name} at t = {self.t:.2f} s: {self.quantity} is {_shown(self.recorded)}{unit} in the record "
            f"and {_shown(self.replayed)}{unit} in the replay"
        )


def _shown(value: Any) -> str:
    return repr(value) if isinstance(value, float | str) else str(value)


def same(a: Any, b: Any) -> bool:
    """Return whether two values are the same, numbers within `TOLERANCE`.

    Examples
    --------
    >>> same(1.0, 1.0 + 1e-10), same(1.0, 1.0 + 1e-8), same({"w": 1.0}, {"w": 1.0}), same(float("nan"), float("nan"))
    (True, False, True, True)
    """
    if isinstance(a, float) and isinstance(b, float):
        return a == b or abs(a - b) <= TOLERANCE or (isnan(a) and isnan(b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[name], b[name]) for name in a)
    return bool(a == b)


def message_difference(recorded: AnyMessage | None, replayed: AnyMessage | None) -> Difference | None:
    """Return the first field in which two states, or two measurements, differ; None if there is none."""
    known = recorded or replayed
    if known is None:
        return None
    name = known.to if isinstance(known, Measurement) else known.sender
    kind = type(known).__name__
    if recorded is None or replayed is None or type(recorded) is not type(replayed):
        return Difference(name, known.t, f"the {kind} {known.seq}", _is_there(recorded), _is_there(replayed))
    for field in recorded.__struct_fields__:
        a, b = getattr(recorded, field), getattr(replayed, field)
        if not same(a, b):
            return Difference(name, recorded.t, field, a, b, UNITS.get(field, ""))
    return None


def _is_there(message: AnyMessage | None) -> str:
    return "missing" if message is None else "there"


def row_difference(
    inverters: tuple[str, ...], recorded: tuple[float, ...], replayed: tuple[float, ...]
) -> Difference | None:
    """Return the first quantity in which two rows of the plant differ; None if there is none."""
    if len(recorded) != len(replayed):
        return Difference("plant", recorded[0], "the number of columns", len(recorded), len(replayed))
    for (name, quantity), a, b in zip(_columns(inverters), recorded[1:], replayed[1:], strict=True):
        if not same(a, b):
            symbol, _, unit = quantity.rpartition("_")
            return Difference(name, recorded[0], symbol, a, b, unit)
    return None


def _columns(inverters: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    return ((name, quantity) for name in inverters for quantity in QUANTITIES)
