"""A disturbance of a run, as the entries of a scenario file that make it: so a scenario can say all that chaos can."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from math import inf
from typing import Any, Literal

import msgspec

from gridpeers.wire.wording import counted

Table = Literal["event", "link", "partition", "node"]

KINDS: Mapping[str, tuple[str, str]] = {
    "cut": ("cut", "cuts"),
    "delay": ("delay", "delays"),
    "loss": ("loss", "losses"),
    "duplicate": ("duplication", "duplications"),
    "corrupt": ("corruption", "corruptions"),
    "partition": ("partition", "partitions"),
    "pause": ("pause", "pauses"),
    "slow_s": ("slow agent", "slow agents"),
    "kill": ("kill", "kills"),
    "lies": ("lie", "lies"),
    "leave": ("leave", "leaves"),
    "join": ("join", "joins"),
    "open": ("switch opened", "switches opened"),
    "close": ("switch closed", "switches closed"),
    "load": ("change of loads", "changes of loads"),
}
"""Kinds of disturbances by the key that makes them, or by their table: the noun for one, and for several."""


class Disturbance(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One thing that is done to a run.

    Examples
    --------
    >>> cut = Disturbance(table="link", entry={"on": "inv1 <-> inv4", "from_s": 2.0, "to_s": 3.0, "cut": True})
    >>> str(cut), cut.settled_s
    ('2 to 3 s: link on = inv1 <-> inv4, cut = true', 3.0)
    >>> str(Disturbance(table="event", entry={"t_s": 2.0, "leave": ["inv2"]}))
    '2 s: event leave = [inv2]'
    """

    table: Table
    entry: Mapping[str, Any]
    back: Mapping[str, Any] = {}
    """Of an event: the later event that takes it back; empty if none does."""

    @property
    def begins_s(self) -> float:
        return float(self.entry["t_s" if self.table == "event" else "from_s"])

    @property
    def settled_s(self) -> float:
        """Run time (s) at which its last change comes: its end, or its beginning if it stays."""
        if self.table == "event":
            return float(self.back.get("t_s", self.begins_s))
        return float(self.entry.get("to_s", self.begins_s))

    @property
    def ends_s(self) -> float:
        """Run time (s) at which it ends; infinity if it stays."""
        if self.table == "event":
            return float(self.back.get("t_s", inf))
        return float(self.entry.get("to_s", inf))

    @property
    def kind(self) -> str:
        """Key of its kind in `KINDS`: its table, or the first key of its entry that is one."""
        return next(key for key in (self.table, *self.entry) if key in KINDS)

    def __str__(self) -> str:
        times = ("t_s", "from_s", "to_s")
        until = "" if self.ends_s == inf else f" to {self.ends_s:g}"
        what = ", ".join(f"{key} = {_word(value)}" for key, value in self.entry.items() if key not in times)
        return f"{self.begins_s:g}{until} s: {self.table} {what}"


Schedule = tuple[Disturbance, ...]
"""Disturbances of one run, as they were drawn: not in the order of time."""


def counted_kinds(schedules: Iterable[Schedule]) -> str:
    """Return how many disturbances of each kind schedules have: "1 kill, 2 lies"; "none"."""
    numbers = Counter(disturbance.kind for schedule in schedules for disturbance in schedule)
    return ", ".join(counted(numbers[key], *nouns) for key, nouns in KINDS.items() if numbers[key]) or "none"


def _word(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {_word(of)}" for key, of in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_word, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)
