"""A disturbance of a run, as the entries of a scenario file that make it: so a scenario can say all that chaos can."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from math import inf
from typing import Any, Literal

import msgspec

KINDS = (
    *("cut", "delay", "loss", "duplicate", "corrupt", "partition", "pause", "slow_s", "kill", "lies"),
    *("leave", "join", "open", "close", "load"),
)
"""Kinds of disturbances: the key that makes them, or their table."""


class Disturbance(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One disturbance.

    Examples
    --------
    >>> cut = Disturbance(table="link", entry={"on": "inv1 <-> inv4", "from_s": 2.0, "to_s": 3.0, "cut": True})
    >>> str(cut), cut.settled_s
    ('2 to 3 s: link on = inv1 <-> inv4, cut = true', 3.0)
    >>> str(Disturbance(table="event", entry={"t_s": 2.0, "leave": ["inv2"]}))
    '2 s: event leave = [inv2]'
    """

    table: Literal["event", "link", "partition", "node"]
    entry: Mapping[str, Any]
    back: Mapping[str, Any] = {}

    @property
    def begins_s(self) -> float:
        return float(self.entry["t_s" if self.table == "event" else "from_s"])

    @property
    def ends_s(self) -> float:
        return float(self.back.get("t_s", inf) if self.table == "event" else self.entry.get("to_s", inf))

    @property
    def settled_s(self) -> float:
        """Run time (s) of its last change: its end, or its beginning if it stays."""
        return self.begins_s if self.ends_s == inf else self.ends_s

    @property
    def kind(self) -> str:
        return next(key for key in (self.table, *self.entry) if key in KINDS)

    def __str__(self) -> str:
        until = "" if self.ends_s == inf else f" to {self.ends_s:g}"
        what = {key: value for key, value in self.entry.items() if key not in ("t_s", "from_s", "to_s")}
        return f"{self.begins_s:g}{until} s: {self.table} {_pairs(what)}"


Schedule = tuple[Disturbance, ...]
"""Disturbances of one run, as they were drawn: not in the order of time."""


def counted_kinds(schedules: Iterable[Schedule]) -> str:
    numbers = Counter(disturbance.kind for schedule in schedules for disturbance in schedule)
    return ", ".join(f"{kind} {numbers[kind]}" for kind in KINDS if numbers[kind]) or "none"


def _pairs(entry: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} = {_word(value)}" for key, value in entry.items())


def _word(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + _pairs(value) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_word, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
