"""The journal entries that say how agents decide: where each is in the file, and up to when the record has them.

In simulated time an entry holds until the next one of its agent, which may be minutes away: one pass over the file
notes the places of the entries. In real time each decision has its own entry.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections import defaultdict
from functools import lru_cache
from math import inf

from gridpeers.scenarios.record.message_index import MessageIndex
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.journal import Decision
from gridpeers.wire.messages import PLANT, Journal, State


class JournalEnds:
    """Up to when it is known how an agent decides in simulated time: a killed process has not sent its last part.

    With emulated links its journal comes in parts all the time. Without, each change has a part of its own at once.
    """

    def __init__(self, info: RecordInfo) -> None:
        self._in_parts = {config.name for config in info.agents if config.links}
        self._ends: dict[tuple[str, int], float] = {}
        """Run time of the last part (s), by agent and epoch."""

    def take(self, journal: Journal) -> None:
        one = journal.sender, journal.epoch
        self._ends[one] = max(journal.t, self._ends.get(one, 0.0))

    def know(self, agent: str, epoch: int, t: float) -> bool:
        """Return whether the record says how a process of an agent decided at a run time (s)."""
        return agent not in self._in_parts or t <= self._ends.get((agent, epoch), -inf) + 1e-9


class DecisionEntries:
    def __init__(self, index: MessageIndex) -> None:
        self._index = index
        self._parts = 0
        self._places: dict[str, list[tuple[int, int]]] = {}
        """By agent: the first tick of each part that has entries of it, and the number of this part."""
        self._ends = JournalEnds(index.info)
        self._in_part = lru_cache(maxsize=64)(self._read_part)

    def at(self, agent: str, tick: int) -> Decision | None:
        """Return the entry that holds at a tick of simulated time; None before the first one.

        Behind the end of a killed process's journal another one may have held: ask `know` first.
        """
        self._go_through()
        places = self._places.get(agent, [])
        place = bisect_right(places, (tick, self._parts)) - 1
        if place < 0:
            return None
        entries = self._in_part(places[place][1])[agent]
        return entries[max(each for each in entries if each <= tick)]

    def know(self, state: State, t: float) -> bool:
        """Return whether the record says how an agent decided a state of a run time (s), in simulated time."""
        self._go_through()
        return self._ends.know(state.sender, state.epoch, t)

    def _go_through(self) -> None:
        """Note where the entries of the parts are that are new."""
        for part in range(self._parts, self._index.parts):
            first_in_part: dict[str, int] = {}
            for journal in self._index.journals_in(part):
                self._ends.take(journal)
                if journal.sender == PLANT:
                    continue
                for entry in self._index.entries_in(journal):
                    if isinstance(entry, Decision):
                        first_in_part.setdefault(journal.sender, entry.tick)
                        break
            for name, first in first_in_part.items():
                insort(self._places.setdefault(name, []), (first, part))
        self._parts = self._index.parts

    def _read_part(self, part: int) -> dict[str, dict[int, Decision]]:
        found: dict[str, dict[int, Decision]] = defaultdict(dict)
        for journal, entry in self._index.part(part).entries:
            if isinstance(entry, Decision):
                found[journal.sender][entry.tick] = entry
        return found
