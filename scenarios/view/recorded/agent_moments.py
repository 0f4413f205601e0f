"""Agents of a record at a time: their last decisions, whom they heard, and how much they sent."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import Counter, defaultdict
from functools import lru_cache
from typing import NamedTuple

from scenarios.record.record_reader import RunRecord
from wire.journal import Decision
from wire.messages import PLANT, Measurement, State

GONE = 0.5
"""Wall-clock: time (s) without a decision after which an agent counts as not there, if that is 2.5 control periods."""


class AgentMoment(NamedTuple):
    """An agent at its last decision before a time."""

    name: str
    t: float
    """Run time of the decision (s)."""
    island: str
    """Name of its island."""
    neighbours: tuple[str, ...]
    """In-neighbours that it had met."""
    ages: tuple[float, ...]
    """Age (s of run time) of the last state of each; -1 if none was heard."""
    used: tuple[str, ...]
    """Neighbours in its sums."""
    idle: bool
    """Whether it was paused, without a measurement, or its law had failed."""


class AgentMoments:
    """Find the last decisions of all agents at any time.

    In simulated time an entry on how an agent decides holds until the next one, which may be minutes away. So the parts
    of the file are gone through once, and where each agent has entries is kept.

    Parameters
    ----------
    record : RunRecord
        The record.
    """

    def __init__(self, record: RunRecord) -> None:
        self._index, self._info = record.index, record.info
        self._parts = 0
        """Parts that were gone through."""
        self._places: dict[str, tuple[list[int], list[int]]] = {}
        """Of each agent: first ticks of the parts that have entries of it, and these parts."""
        self._entries_in = lru_cache(maxsize=64)(self._read_entries)
        self._sent_in = lru_cache(maxsize=64)(self._read_sent)

    def at(self, t: float) -> dict[str, AgentMoment]:
        """Return the agents that were there at a run time (s), by name."""
        if self._info.level == "physics":
            return {}
        found = (self._in_ticks if self._info.clock == "simulated" else self._live)(t)
        return {moment.name: moment for moment in found}

    def sent(self, since: float, until: float) -> Counter[str]:
        """Return how many states each agent sent to its neighbours after a run time (s) and up to another one."""
        counts: Counter[str] = Counter()
        for part in self._index.near(since, until):
            for name, times in self._sent_in(part).items():
                counts[name] += bisect_right(times, until + 1e-9) - bisect_right(times, since + 1e-9)
        return counts

    # ---------------------------------------------------------------- simulated time

    def _in_ticks(self, t: float) -> list[AgentMoment]:
        self._go_through()
        T_c = self._info.T_c
        last, moments = int(t / T_c + 1e-6), []
        for config in self._info.agents:
            for tick in range(last, max(-1, last - 2), -1):
                state = self._index.state(config.name, tick, tick * T_c)
                if state is not None:
                    moments.append(self._at_tick(state, tick * T_c))
                    break
        return moments

    def _at_tick(self, state: State, t: float) -> AgentMoment:
        form = None if state.idle else self._form(state.sender, state.seq)
        measured = self._index.measurement(state.sender, state.seq, t)
        island = state.island if measured is None else measured.island
        T_c = self._info.T_c
        ages = () if form is None else tuple(-1.0 if lag is None else round(lag * T_c, 9) for lag in form.states)
        return _moment(state.sender, t, island, form, ages, idle=state.idle)

    def _form(self, name: str, tick: int) -> Decision | None:
        """Return the entry that says how an agent decided at a tick."""
        first_ticks, parts = self._places.get(name, ([], []))
        place = bisect_right(first_ticks, tick) - 1
        if place < 0:
            return None
        ticks, entries = self._entries_in(parts[place])[name]
        return entries[bisect_right(ticks, tick) - 1]

    def _read_entries(self, part: int) -> dict[str, tuple[list[int], list[Decision]]]:
        """Return the entries of each agent in a part, and their ticks."""
        found: dict[str, dict[int, Decision]] = defaultdict(dict)
        for journal in self._index.journals_in(part):
            if journal.sender != PLANT:
                for entry in self._index.entries_in(journal):
                    if isinstance(entry, Decision):
                        found[journal.sender][entry.tick] = entry
        return {name: (sorted(by_tick), [by_tick[tick] for tick in sorted(by_tick)]) for name, by_tick in found.items()}

    def _go_through(self) -> None:
        for part in range(self._parts, self._index.parts):
            for name, (ticks, _) in self._read_entries(part).items():
                first_ticks, parts = self._places.setdefault(name, ([], []))
                at = bisect_left(first_ticks, ticks[0])
                first_ticks.insert(at, ticks[0])
                parts.insert(at, part)
        self._parts = self._index.parts

    # ---------------------------------------------------------------- wall-clock time

    def _live(self, t: float) -> list[AgentMoment]:
        gone = max(GONE * max(1.0, self._info.plant.speed), 2.5 * self._info.T_c)
        last: dict[str, tuple[Measurement, Decision]] = {}
        for part in self._index.near(t - gone, t):
            for journal, entry in self._index.part(part).entries:
                if isinstance(entry, Decision):
                    own = self._index.measurement(journal.sender, entry.measurement, journal.t)
                    before = last.get(journal.sender)
                    if own is None or not t - gone <= own.t <= t + 1e-9 or (before and before[0].t > own.t):
                        continue
                    last[journal.sender] = own, entry
        return [
            _moment(name, own.t, own.island, entry, tuple(-1.0 if age is None else age for age in entry.ages))
            for name, (own, entry) in last.items()
        ]

    # ---------------------------------------------------------------- both

    def _read_sent(self, part: int) -> dict[str, list[float]]:
        times: dict[str, list[float]] = defaultdict(list)
        for (name, _), states in self._index.part(part).states.items():
            times[name] += [state.t for state in states[:1] if not (state.quiet or state.idle)]
        return {name: sorted(each) for name, each in times.items()}


def _moment(
    name: str, t: float, island: str, form: Decision | None, ages: tuple[float, ...], *, idle: bool = False
) -> AgentMoment:
    if form is None:
        return AgentMoment(name, t, island, (), (), (), idle)
    unused = form.unused or [""] * len(form.neighbours)
    used = tuple(each for each, why in zip(form.neighbours, unused, strict=False) if not why)
    neighbours = tuple(form.neighbours)
    return AgentMoment(name, t, island, neighbours, (*ages, *[-1.0] * len(neighbours))[: len(neighbours)], used, idle)
