"""Accounts of what was sent over links in simulated time, kept while a pass over a record goes on: what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

from gridpeers.lab.communication.neighbour_use import Uses
from gridpeers.lab.communication.record_pass import Link
from gridpeers.lab.communication.sent_states import SentState, SentStates
from gridpeers.netem.ledger import LinkTrace
from gridpeers.scenarios.record.decision_entries import Hole, inside
from gridpeers.wire.messages import PLANT

WAIT = 1000
"""Verdicts of an emulated link after which a state without one has none: a link judges what it gets at once."""


@dataclass
class Missing:
    """States that are missing on a link."""

    count: int = 0
    first: float = 0.0
    """Run time of the first one (s)."""

    def add(self, t: float) -> None:
        if not self.count:
            self.first = t
        self.count += 1


class TickAccounts:
    """Simulated time without emulated links: every decision has the neighbours' states of the tick before."""

    def __init__(self, sent: Mapping[str, SentStates], T_c: float, lost: Sequence[Hole] = ()) -> None:
        self._sent, self._T_c, self._lost = sent, T_c, lost
        self._spoken: dict[int, set[str]] = {}
        """Agents that told their neighbours something, by tick."""
        self.missing: dict[Link, Missing] = {}
        """What each link over which an agent listens lacks."""

    def state(self, agent: str, state: SentState) -> None:
        if not (state.quiet or state.idle):
            if state.number not in self._spoken:
                self._spoken[state.number] = set()
                if len(self._spoken) > WAIT:
                    del self._spoken[next(iter(self._spoken))]
            self._spoken[state.number].add(agent)

    def use(self, agent: str, state: SentState, uses: Uses, *, new: bool) -> None:
        """Note the states that an own state came of."""
        if new:
            for use in uses.each:
                self.missing.setdefault(use.link, Missing())
        before = state.number - 1
        if uses.last_tick is not None and uses.last_tick <= self._spoken.get(before, frozenset()):
            return
        own = self._sent[agent].window_at(state.t).decided(before)
        for use in uses.each:
            window = self._sent[use.link[0]].window_at(state.t)
            spoke = window.spoke(before)
            if use.ticks == 1 and spoke:
                continue
            newer = spoke and own and use.ticks != 1
            number = use.number_at(state.number)
            invented = number is not None and not use.unused and not (window.has(number) or window.is_past(number))
            invented = invented and not inside(self._lost, (number or 0) * self._T_c)
            if newer or invented:
                self.missing[use.link].add(state.t)


@dataclass
class _Verdicts:
    """Verdicts of one link: all numbers up to `done` are decided, those ahead have a verdict."""

    done: int
    highest: int = -1
    ahead: set[int] = field(default_factory=set)
    missing: Missing = field(default_factory=Missing)


class VerdictAccounts:
    """Simulated time with emulated links: every state between the first and the last verdict of a link has one."""

    def __init__(self, sent: Mapping[str, SentStates]) -> None:
        self._sent = sent
        self._links: dict[Link, _Verdicts] = {}

    def trace(self, trace: LinkTrace) -> None:
        link = trace.src, trace.dst
        if PLANT in link or not trace.seq:
            return
        of = self._links.setdefault(link, _Verdicts(done=min(trace.seq) - 1))
        of.ahead.update(number for number in trace.seq if number > of.done)
        of.highest = max(of.highest, *trace.seq)
        self._advance(link, of, of.highest - WAIT)

    def missing(self) -> dict[Link, Missing]:
        """Return the states without a verdict, by link, once all verdicts are there."""
        for link, of in self._links.items():
            self._advance(link, of, of.highest)
        return {link: of.missing for link, of in self._links.items()}

    def _advance(self, link: Link, of: _Verdicts, until: int) -> None:
        """Decide all numbers up to one: of those that its sender has sent, so that a false one takes no time."""
        if until <= of.done:
            return
        src, dst = (self._sent[name].window_at(inf) for name in link)
        for number in src.numbers(of.done, until):
            if number not in of.ahead and src.spoke(number) and dst.has(number) and dst.has(number + 1):
                of.missing.add(src.t(number) or 0.0)
        if until - of.done > len(of.ahead):
            of.ahead = {number for number in of.ahead if number > until}
        else:
            of.ahead.difference_update(range(of.done + 1, until + 1))
        of.done = until
