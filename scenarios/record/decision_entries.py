"""The journal entries that say how agents decide: where each is in the file, and where parts of a journal are lost.

In simulated time an entry holds until the next one of its agent, which may be minutes away: one pass over the file
notes the places of the entries. In wall-clock time each decision has its own entry.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from math import inf

from gridpeers.scenarios.record.message_index import MessageIndex
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.journal import Decision, Exchange
from gridpeers.wire.messages import PLANT, Journal
from gridpeers.wire.timing import time_of

Hole = tuple[float, float]
"""Run times (s) between which something is lost: the first one excluded, the last one included."""

INSTANT = 1e-6  # Run time (s) far below any control period


class JournalCoverage:
    """Follow the parts of one journal by their numbers, and find where some are lost.

    A periodic journal has parts all the time; any other has one with each change.
    """

    def __init__(self, *, periodic: bool) -> None:
        self._periodic = periodic
        self._epoch = self._number = -1
        self._t = -1.0
        """Run time of the last part (s)."""
        self._span: Callable[[], Hole | None] = lambda: None
        self._since: float | None = None
        """Run time (s) since which parts are lost; None once a later part says how the agent decided."""
        self._gaps: list[Hole] = []

    @property
    def known_until(self) -> float:
        """Run time (s) after which nothing is known: a run that goes on, or was killed, lacks its last parts."""
        return self._t if self._periodic else inf

    def take(self, journal: Journal, span: Callable[[], Hole | None]) -> None:
        """Take the next part; `span`, called only next to a lost part, returns the run times (s) that it covers."""
        restarted = journal.epoch != self._epoch
        if not restarted and journal.seq <= self._number:
            return  # published again
        whole = journal.seq == (0 if restarted else self._number + 1)
        unfinished = restarted and self._periodic and self._epoch >= 0  # the last part of a killed process is missing
        if (not whole or unfinished) and self._since is None:
            before = self._span()
            self._since = self._t if before is None else before[1]
        self._epoch, self._number, self._t, self._span = journal.epoch, journal.seq, max(self._t, journal.t), span
        if self._since is not None and (known := span()) is not None:
            self._gaps.append((self._since, known[0] - INSTANT))
            self._since = None

    def holes(self, damaged: Sequence[Hole]) -> list[Hole]:
        """Return where parts are lost, by their numbers or by the run times (s) of damaged chunks of the file."""
        since = self._since
        behind = [begin for begin, end in damaged if end >= self._t]
        if since is None and behind:  # no part came after it, which would tell by its number what is lost
            since = self._t if self._periodic else max(self._t, min(behind) - INSTANT)
        return self._gaps if since is None else [*self._gaps, (since, inf)]


def inside(holes: Sequence[Hole], t: float) -> bool:
    return any(since < t <= until for since, until in holes)


class DecisionEntries:
    def __init__(self, index: MessageIndex) -> None:
        self._index, self._info = index, index.info
        self._simulated = self._info.simulated
        self._parts = 0
        self._places: dict[str, list[tuple[int, int]]] = {}
        """By agent: the first tick of each part that has entries of it, and the number of this part."""
        self._coverage: dict[str, JournalCoverage] = {}
        self._holes: dict[str, Sequence[Hole]] = {}
        self._in_part = lru_cache(maxsize=64)(self._read_part)

    def at(self, agent: str, tick: int) -> Decision | None:
        """Return the entry that holds at a tick of simulated time; None before the first one.

        Where entries are lost, another one may have held: ask `knows` first.
        """
        self._go_through()
        places = self._places.get(agent, [])
        place = bisect_right(places, (tick, self._parts)) - 1
        if place < 0:
            return None
        entries = self._in_part(places[place][1])[agent]
        return entries[max(each for each in entries if each <= tick)]

    def knows(self, agent: str, t: float) -> bool:
        """Return whether the record says how an agent decided at a run time (s) of simulated time."""
        self._go_through()
        return t <= self._covered(agent).known_until + 1e-9 and not inside(self.holes(agent), t)

    def holes(self, node: str) -> Sequence[Hole]:
        """Return the run times (s) between which decisions of an agent, or messages of the plant, are lost.

        A decision of simulated time starts from the state of the tick before, which the plant has noted.
        """
        if not (self._simulated or self._index.file.holes):
            return ()
        self._go_through()
        if node not in self._holes:
            found = self._covered(node).holes(self._index.file.holes)
            if node != PLANT:
                later = self._info.T_c if self._simulated else 0.0
                found = sorted({*found, *((since, until + later) for since, until in self.holes(PLANT))})
            self._holes[node] = found
        return self._holes[node]

    def lost_at(self, agent: str, t: float, last: float | None) -> bool:
        """Return whether the decision of an agent in force at t (s) is lost; `last` is the time of the last known."""
        T_c = self._info.T_c
        at = time_of(int(t / T_c + 1e-6), T_c) if self._simulated else t - T_c + INSTANT
        return any(
            begin < at <= until and (last is None or last <= begin + INSTANT) for begin, until in self.holes(agent)
        )

    def _covered(self, node: str) -> JournalCoverage:
        if node not in self._coverage:
            self._coverage[node] = JournalCoverage(periodic=is_periodic(self._info, node))
        return self._coverage[node]

    def _go_through(self) -> None:
        """Note where the entries of the parts are that are new, and which parts of journals are lost."""
        if self._parts == self._index.parts:
            return
        self._holes.clear()
        for part in range(self._parts, self._index.parts):
            first_in_part: dict[str, int] = {}
            for journal in self._index.journals_in(part):
                first = None
                if self._simulated and journal.sender != PLANT:
                    entries = self._index.entries_in(journal)
                    first = next((entry.tick for entry in entries if isinstance(entry, Decision)), None)
                if first is not None:
                    first_in_part.setdefault(journal.sender, first)
                self._covered(journal.sender).take(journal, partial(self._span, journal, first))
            for name, first in first_in_part.items():
                insort(self._places.setdefault(name, []), (first, part))
        self._parts = self._index.parts

    def _span(self, journal: Journal, first: int | None) -> Hole | None:
        """Return the first and the last run time (s) that a part of a journal covers; None if it covers none."""
        if not self._simulated:  # each entry is complete by itself
            return journal.t, journal.t
        T_c = self._info.T_c
        if journal.sender != PLANT:  # the last entry holds on
            return None if first is None else (time_of(first, T_c), journal.t)
        ticks = [entry.tick for entry in self._index.entries_in(journal) if isinstance(entry, Exchange)]
        return (time_of(ticks[0], T_c), time_of(ticks[-1], T_c)) if ticks else None

    def _read_part(self, part: int) -> dict[str, dict[int, Decision]]:
        found: dict[str, dict[int, Decision]] = defaultdict(dict)
        for journal, entry in self._index.part(part).entries:
            if isinstance(entry, Decision):
                found[journal.sender][entry.tick] = entry
        return found


def is_periodic(info: RecordInfo, node: str) -> bool:
    """Return whether the journal of a node comes in parts all the time: of the plant, and of agents with links."""
    config = info.agent(node)
    return config is None or info.clock == "wall" or bool(config.links)
