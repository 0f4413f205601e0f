"""Counters for the checks of communication, found in one pass over the file of a record.

The memory of the pass does not grow with the length of the run: of each agent it keeps its last states and decisions,
of each link counters, and the numbers of messages that are still on their way. Journals of different nodes come into a
record with a delay; so a decision is looked at a while after its run time, once all its inputs are there.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Self

from gridpeers.lab.communication.accounts import ArrivalAccounts, Heal, Heals, TickAccounts
from gridpeers.lab.communication.record_pass import RecordPass, opened
from gridpeers.lab.communication.sent_states import (
    DecidedStates,
    DecidedTicks,
    Link,
    NeighbourUse,
    SentState,
    SentStates,
    Uses,
)
from gridpeers.netem.ledger import LinkTrace
from gridpeers.scenarios.record.decision_entries import Hole
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.wire.journal import Decision
from gridpeers.wire.messages import PLANT
from gridpeers.wire.timing import PATIENCE

DELAY_TICKS, DELAY = 300, 5.0
"""How long after its run time a decision is looked at: ticks of simulated time, where a journal comes every 100
ticks at the latest; seconds of real time, where it comes every 0.2 s."""

PAUSE = 1.5  # Silence of a process (s of wall time) after which its links may be given up: Zenoh gives them 2 s

LINKED_WITHIN = 2.0 * PATIENCE
"""Time (s of wall time) within which two processes hear each other: a session that brings nothing is given up after
`PATIENCE`, and the next one may take as long."""


@dataclass
class OldUse:
    """Use of a neighbour's value that is older than all values of this neighbour that the agent used later."""

    age: float
    t: float
    """Run time of the first decision that used one of this age (s)."""
    last: float


def summarise(path: Path) -> CommunicationSummary:
    """Go through the file of a record once, twice if parts of it are lost; NotJudgedError if it has no decisions."""
    file, t_end = opened(path)
    found = CommunicationSummary(file.info, t_end).read(file)
    last = t_end - 2.0 * file.info.T_c
    lost = {name: holes for name, each in found.holes.items() if (holes := [hole for hole in each if hole[0] < last])}
    if lost:  # known only now, and left out the second time
        file, _ = opened(path)
        found = CommunicationSummary(file.info, t_end, lost).read(file)
    return found.finish()


class CommunicationSummary(RecordPass):
    """What a pass over a record found; `lost` has the parts of journals that an earlier pass missed."""

    def __init__(
        self, info: RecordInfo, t_end: float, lost: Mapping[str, Sequence[Hole]] = MappingProxyType({})
    ) -> None:
        super().__init__(info, t_end)
        self._lost = lost
        self._simulated = simulated = info.simulated
        speed = max(1.0, info.plant.speed)
        self._delay = DELAY_TICKS * info.T_c if simulated else DELAY * speed
        self._names = frozenset(info.agent_names)
        self.sent: defaultdict[str, SentStates] = defaultdict(lambda: SentStates(simulated=simulated))
        self._decided: dict[str, DecidedTicks | DecidedStates] = {}
        self._ticks = TickAccounts(self.sent, info.T_c, lost.get(PLANT, ()))
        self._arrivals = ArrivalAccounts(PAUSE * speed, LINKED_WITHIN * speed)
        self._heals = Heals(info, t_end, self.sent)
        self.unheard = self._ticks.missing
        """Simulated time: decisions without the state of the tick before, by link; for those without faults."""
        self.arrivals = self._arrivals.accounts
        """Real time: what came over each link, for each time in which both of its ends were there."""
        self.oldest: defaultdict[Link, list[OldUse]] = defaultdict(list)
        """By link, the oldest value that was used, then the oldest one that was used later, and so on: ages fall."""
        self.heals: list[Heal] = []
        self._alike: dict[str, tuple[Uses, list[OldUse]]] = {}
        """By agent, the neighbours that its decision in force uses, and the last entries in `oldest` of their links. An
        agent for which quiet states change the ages from tick to tick is left out."""
        self._t = self._flushed = 0.0

    def take_state(self, agent: str, state: SentState) -> None:
        if agent not in self._names or not self.sent[agent].put(state):
            return
        self._of(agent).state(state)
        (self._ticks if self._simulated else self._arrivals).state(agent, state)
        self._t = max(self._t, state.t)
        if self._t > self._flushed + 1.25 * self._delay:
            self._flush(self._t - self._delay)

    def take_decision(self, agent: str, epoch: int, decision: Decision) -> None:
        if agent not in self._names:
            return
        self._of(agent).decision(epoch, decision)
        if not self._simulated:
            for name in self._names.intersection(decision.neighbours):
                self._arrivals.listens((name, agent))

    def take_heard(self, link: Link, epoch: int, number: int, rejected: str) -> None:
        if not self._simulated and self._names.issuperset(link):
            self._arrivals.heard(link, epoch, number)

    def take_renewed(self, agent: str, t: float) -> None:
        self._arrivals.renewed(agent, t)

    def take_trace(self, trace: LinkTrace) -> None:
        self._heals.trace(trace)

    def finish(self) -> Self:
        self._flush(inf)
        self.heals = self._heals.found()
        return self

    def _of(self, agent: str) -> DecidedTicks | DecidedStates:
        if agent not in self._decided:
            T_c = self.info.T_c
            self._decided[agent] = (
                DecidedTicks(agent, T_c, self._lost.get(agent, ()))
                if self._simulated
                else DecidedStates(agent, T_c, self.sent[agent])
            )
        return self._decided[agent]

    def _flush(self, until: float) -> None:
        self._flushed = until
        for agent, decided in self._decided.items():
            for state, uses, new in decided.flush(until):
                self._note_ages(agent, state, uses)
                if self._simulated:
                    self._ticks.use(agent, state, uses, new=new)
                self._heals.use(agent, state, uses, new=new)
        if not self._simulated:
            self._arrivals.flush(until)

    def _note_ages(self, agent: str, state: SentState, uses: Uses) -> None:
        alike = self._alike.get(agent)
        if alike is not None and alike[0] is uses:
            for old in alike[1]:
                old.last = state.t
            return
        used = [use for use in uses.each if not use.unused]
        for use in used:
            self._note_age(state, use)
        if all(self._is_plain(use.age) for use in used):
            self._alike[agent] = uses, [self.oldest[use.link][-1] for use in used]

    def _is_plain(self, age: float | None) -> bool:
        return age is None or not 1.5 * self.info.T_c < age < inf

    def _note_age(self, state: SentState, use: NeighbourUse) -> None:
        """Note the age of a value, counted from the last tick at which its sender kept it in force."""
        age = inf if use.age is None else use.age
        if not self._is_plain(age) and (number := use.number_at(state.number)) is not None:
            kept = self.sent[use.link[0]].window_at(state.t).kept_until(number)
            age = max(0.0, age - (kept - number) * self.info.T_c)
        old = self.oldest[use.link]
        while old and old[-1].age < age:
            old.pop()
        if old and old[-1].age == age:
            old[-1].last = state.t
        else:
            old.append(OldUse(age, state.t, state.t))
