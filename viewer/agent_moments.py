"""Agents of a record at a time: their last decisions, whom they heard, and how much they sent."""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter, defaultdict
from functools import lru_cache
from typing import NamedTuple

from gridpeers.scenarios.record.decision_entries import inside
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.journal import Decision
from gridpeers.wire.messages import PLANT, Measurement, State

GONE = 0.5
"""Wall-clock: time (s) without a decision after which an agent counts as not there, if that is 2.5 control periods."""


class AgentMoment(NamedTuple):
    name: str
    t: float
    island: str
    neighbours: tuple[str, ...]
    ages: tuple[float, ...]
    """Age (s of run time) of the last state of each; -1 if none was heard."""
    used: tuple[str, ...]
    idle: bool
    """It was paused, it had no measurement, or its law had failed."""
    known: bool = True
    """The record says how it decided; False where a part of its journal is missing."""
    damaged: bool = False
    """That part is lost because the file is damaged there."""


class AgentMoments:
    def __init__(self, record: RunRecord) -> None:
        self._index, self._info, self._entries = record.index, record.info, record.entries_of_decisions
        self._gone = max(GONE * max(1.0, self._info.plant.speed), 2.5 * self._info.T_c)
        self._sent_in = lru_cache(maxsize=64)(self._read_sent)

    def at(self, t: float) -> dict[str, AgentMoment]:
        if self._info.level == "physics":
            return {}
        found = (self._in_ticks if self._info.simulated else self._live)(t)
        return self._perhaps_there(t) | {moment.name: moment for moment in found}

    def sent(self, since: float, until: float) -> Counter[str]:
        counts: Counter[str] = Counter()
        for part in self._index.near(since, until):
            for name, times in self._sent_in(part).items():
                counts[name] += bisect_right(times, until + 1e-9) - bisect_right(times, since + 1e-9)
        return counts

    def lost(self, since: float, until: float) -> float:
        """Return how much of the time between two run times (s) is lost, as the file is damaged there."""
        holes = self._entries.holes(PLANT)
        return sum(max(0.0, min(until, end) - max(since, begin)) for begin, end in holes)

    def _in_ticks(self, t: float) -> list[AgentMoment]:
        T_c = self._info.T_c
        last, moments = int(t / T_c + 1e-6), []
        for config in self._info.agents:
            lost = inside(self._entries.holes(config.name), last * T_c)
            for tick in range(last, max(-1, last - (1 if lost else 2)), -1):
                state = self._index.state(config.name, tick, tick * T_c)
                if state is not None:
                    moments.append(self._at_tick(state, tick * T_c))
                    break
        return moments

    def _at_tick(self, state: State, t: float) -> AgentMoment:
        name, measured = state.sender, self._index.measurement(state.sender, state.seq, t)
        if measured is None or not (state.idle or self._entries.knows(name, t)):
            island = state.island if measured is None else measured.island
            return _unknown(name, t, island, damaged=inside(self._entries.holes(name), t))
        form, T_c = None if state.idle else self._entries.at(name, state.seq), self._info.T_c
        ages = () if form is None else tuple(-1.0 if lag is None else round(lag * T_c, 9) for lag in form.states)
        return _moment(name, t, measured.island, form, ages, idle=state.idle)

    def _live(self, t: float) -> list[AgentMoment]:
        gone = self._gone
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
            _unknown(name, own.t, own.island, damaged=True)
            if self._entries.lost_at(name, t, own.t)
            else _moment(name, own.t, own.island, entry, tuple(-1.0 if age is None else age for age in entry.ages))
            for name, (own, entry) in last.items()
        ]

    def _perhaps_there(self, t: float) -> dict[str, AgentMoment]:
        """Return the agents that may have been there, for all that a damaged file says."""
        simulated = self._info.simulated  # the plant has all states
        since = t - (self._info.T_c if simulated else self._gone)

        def is_lost(node: str) -> bool:
            return any(begin < t and end >= since for begin, end in self._entries.holes(node))

        names = self._info.agent_names
        if not (simulated and is_lost(PLANT)):
            names = () if simulated else tuple(name for name in names if is_lost(name))
        return {name: _unknown(name, t, "", damaged=True) for name in names}

    def _read_sent(self, part: int) -> dict[str, list[float]]:
        times: dict[str, list[float]] = defaultdict(list)
        for (name, _), states in self._index.part(part).states.items():
            times[name] += [state.t for state in states[:1] if not (state.quiet or state.idle)]
        return {name: sorted(each) for name, each in times.items()}


def _unknown(name: str, t: float, island: str, *, damaged: bool) -> AgentMoment:
    return AgentMoment(name, t, island, (), (), (), idle=False, known=False, damaged=damaged)


def _moment(
    name: str, t: float, island: str, form: Decision | None, ages: tuple[float, ...], *, idle: bool = False
) -> AgentMoment:
    if form is None:
        return AgentMoment(name, t, island, (), (), (), idle)
    unused = form.unused or [""] * len(form.neighbours)
    used = tuple(each for each, why in zip(form.neighbours, unused, strict=False) if not why)
    neighbours = tuple(form.neighbours)
    return AgentMoment(name, t, island, neighbours, (*ages, *[-1.0] * len(neighbours))[: len(neighbours)], used, idle)
