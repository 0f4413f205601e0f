"""The checks of what agents said, heard and used: the message account, heals, stale values, last words."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Annotated, Self

from gridpeers.agents.agent_config import MAX_AGE
from gridpeers.lab.communication.accounts import ArrivalAccounts, Heals, LinkHeal, Missing, TickAccounts
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
from gridpeers.scenarios.checks.check_verdict import (
    Check,
    NotJudgedError,
    Since,
    Violation,
    require_longer,
    require_time,
)
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.wire.journal import Decision
from gridpeers.wire.schema.table_schema import Plausible, Unit
from gridpeers.wire.timing import PATIENCE

_NO_ARRIVALS = 'in real time, record = "decisions" has no arrivals'

_SAID = re.compile(r"\S+ (leaves|left|dies)\b")  # Events of an agent that ends as the scenario, or a person, wants it


class MessageAccount(Check):
    """The fate of every state that was sent is known at its receiver, link by link.

    Of emulated links the accounts of their receivers count; of others in simulated time every decision
    has the neighbours' states of the tick before; in real time every number arrives, from the first one on that
    does between two processes, or once both have been there for 7 s (`LINKED_WITHIN`), unless its receiver says that
    it dropped as many. A process that is silent for long, as it is frozen, begins anew: its links are given up.
    """

    in_flight_s: Annotated[float, Unit("s"), Plausible("the time of a message on its way", 0.0, 60.0)] = 1.0
    """Time (s) before the end of the run, or before an agent ends or is frozen, from which on a message may still be
    on its way."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        found: CommunicationSummary = case.communication
        if found.unreadable:
            yield Violation(text="messages or parts of the record that cannot be read", value=found.unreadable, limit=0)
        for (src, dst), counts in sorted(found.counts.items()):
            if not counts.closes:
                sent = counts.sent + counts.duplicated
                text = f"messages of {src} delivered, dropped or in flight, of {sent} sent"
                there = counts.delivered + sum(counts.dropped.values()) + counts.in_flight
                yield Violation(text=text, agent=dst, value=there, limit=sent)
        links = self._without_account(found)
        for agent in found.info.agent_names:
            for link, missing in links.items():
                if link[1] == agent and missing.count:
                    text = f"states of {link[0]} neither heard nor lost"
                    yield Violation(text=text, t=missing.first, agent=agent, value=missing.count, limit=0)
        if not (found.counts or links):
            has_arrivals = found.info.simulated or found.info.level == "all"
            raise NotJudgedError("no agent listens to another" if has_arrivals else _NO_ARRIVALS)
        if links and not (found.counts or found.info.simulated):
            require_longer(found.t_end, "in_flight_s", self.in_flight_s)

    def _without_account(self, found: CommunicationSummary) -> dict[Link, Missing]:
        if found.info.simulated:
            return {link: missing for link, missing in found.unheard.items() if link not in found.counts}
        links: dict[Link, Missing] = {}
        for link in sorted(found.arrivals) if found.info.level == "all" else ():
            links[link] = Missing()
            late = [
                t
                for account in found.arrivals[link]
                for t in account.missing.values()
                if t <= min(account.until, found.t_end) - self.in_flight_s
            ]
            for t in late[found.dropped.get(link, 0) :]:
                links[link].add(t)
        return links


class Rejoined(Check):
    """Some time after the end of each cut, the receiver uses new states of the sender again."""

    within_s: Annotated[float, Unit("s"), Plausible("a time to rejoin", 0.0, 3600.0, above_zero=True)] = 6.0
    """Longest time (s) after the cut. Zenoh needs at most the default to find a lost peer."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        found: CommunicationSummary = case.communication
        if not found.heals:
            raise NotJudgedError("no link was cut and healed")
        judged = 0
        for agent in found.info.agent_names:
            for heal in found.heals:
                took = heal.took
                if took is None and heal.waited > self.within_s:
                    took = inf
                if heal.link[1] != agent or took is None:
                    continue
                judged += 1
                if took > self.within_s:
                    yield Violation(
                        text=f"no new value of {heal.link[0]} is used after the cut ended at {heal.t:g} s",
                        t=heal.t + self.within_s,
                        agent=agent,
                        value=None if took == inf else took,
                        unit="s",
                        limit=self.within_s,
                    )
        if not judged:
            raise NotJudgedError(
                f"after no cut was its link whole, and both of its agents at work, for {self.within_s:g} s"
            )


class StaleValues(Check):
    """No decision uses a neighbour's value that is older than a limit.

    A value that the neighbour's law keeps in force, without sending it again, does not grow older.
    """

    max_age_s: Annotated[float, Unit("s"), Plausible("the greatest age of a state", 0.0, 3600.0)] = 0.0
    """Greatest age (s); 0: `max_age` of the agents, and where they have none, 0.25 s, as in real time."""
    since_s: Since = 0.0

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        found: CommunicationSummary = case.communication
        if not found.oldest:
            raise NotJudgedError("no decision used a neighbour's value")
        require_time(case.history, self.since_s)
        limits = {
            config.name: self.max_age_s or config.control.degraded_communication.max_age or MAX_AGE
            for config in found.info.agents
        }
        beyond = {
            link: use
            for link, uses in found.oldest.items()
            if (use := next((each for each in uses if each.last >= self.since_s), None)) is not None
            and use.age > limits[link[1]] + 0.5 * found.info.T_c
        }
        place = {name: i for i, name in enumerate(found.info.agent_names)}
        order = sorted(beyond, key=lambda link: (-beyond[link].age, place[link[1]], place.get(link[0], 0)))
        for neighbour, agent in order:
            use = beyond[neighbour, agent]
            yield Violation(
                text=f"age of the value of {neighbour} that was used",
                t=max(use.t, self.since_s),
                agent=agent,
                value=use.age if use.age < inf else None,
                unit="s",
                limit=limits[agent],
            )


class LastWords(Check):
    """Each agent sends states until the run ends, or until an event says that it left or was killed.

    An unexplained silence is a failure of the agent, of its process, or of its connection.
    """

    silent_s: Annotated[float, Unit("s"), Plausible("a silence", 0.0, 3600.0)] = 1.0
    """Longest time (s) between an agent's last state and the end of the run, or the event that explains it."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        found: CommunicationSummary = case.communication
        if not any(sent.epochs for sent in found.sent.values()):
            raise NotJudgedError("the record has no states of agents")
        joining = {name for event in case.scenario.events for name in event.join}
        setup = found.info.emulation
        nodes = setup.netem.nodes if setup else ()
        ended = [(node.name, node.from_s, self.silent_s + 2.0 * case.T_c) for node in nodes if node.kill]
        ended += [
            (event.subject, event.t, self.silent_s)
            for event in case.events
            if event.kind == "roster" and _SAID.match(event.text)
        ]
        end = min(float(case.history.t[-1]), found.t_end)
        for agent in found.info.agent_names:
            sent = found.sent.get(agent)
            epochs = sent.epochs if sent else {}
            if not epochs and agent not in joining and found.info.driver != LIVE:
                yield Violation(text="never sends a state", agent=agent, t=0.0)
            for _, last in epochs.values():
                if last >= end - self.silent_s:
                    continue
                if any(name == agent and abs(last - t) <= within for name, t, within in ended):
                    continue
                later = [max(0.0, first - last) for first, then in epochs.values() if then > last]
                yield Violation(
                    text="its process ends, and nobody had asked for it; the next one sends after"
                    if later
                    else "stops sending, and nobody had asked for it",
                    agent=agent,
                    t=last,
                    value=min(later, default=end - last),
                    unit="s",
                    limit=None if later else self.silent_s,
                )
        require_longer(end, "silent_s", self.silent_s)


# -------------------------------------------------------------------- what they read of a record


DELAY_TICKS, DELAY = 300, 5.0
"""How long after its run time a decision is looked at: ticks of simulated time, where a journal comes every 100
ticks at the latest; seconds of real time, where it comes every 0.2 s."""

PAUSE = 1.5  # Silence of a process (s of real time) after which its links may be given up: Zenoh gives them 2 s

LINKED_WITHIN = 2.0 * PATIENCE
"""Time (s of real time) within which two processes hear each other: a session that brings nothing is given up after
`PATIENCE`, and the next one may take as long."""


@dataclass
class OldUse:
    """Use of a neighbour's value that is older than all values of this neighbour that the agent used later."""

    age: float
    t: float
    """Run time of the first decision that used one of this age (s)."""
    last: float


def summarise(path: Path) -> CommunicationSummary:
    """Go through the file of a record once, twice if it is damaged; NotJudgedError if it has no decisions."""
    file, t_end = opened(path)
    found = CommunicationSummary(file.info, t_end).read(file)
    if file.t_end < t_end:  # known only now
        found = CommunicationSummary(file.info, file.t_end).read(file)
    return found.finish()


class CommunicationSummary(RecordPass):
    """What a pass over a record found.

    Its memory does not grow with the run: of each agent it keeps the last states and decisions, of each link counters,
    and the numbers of messages on their way. Journals of different nodes come into a record with a delay; so a decision
    is looked at a while after its run time, once all its inputs are there.
    """

    def __init__(self, info: RecordInfo, t_end: float) -> None:
        super().__init__(info, t_end)
        self._simulated = simulated = info.simulated
        speed = max(1.0, info.plant.speed)
        self._delay = DELAY_TICKS * info.T_c if simulated else DELAY * speed
        self._names = frozenset(info.agent_names)
        self.sent: defaultdict[str, SentStates] = defaultdict(lambda: SentStates(simulated=simulated))
        self._decided: dict[str, DecidedTicks | DecidedStates] = {}
        self._ticks = TickAccounts(self.sent)
        self._arrivals = ArrivalAccounts(PAUSE * speed, LINKED_WITHIN * speed)
        self._heals = Heals(info, t_end, self.sent)
        self.unheard = self._ticks.missing
        """Simulated time: decisions without the state of the tick before, by link; for those without faults."""
        self.arrivals = self._arrivals.accounts
        """Real time: what came over each link, for each time in which both of its ends were there."""
        self.oldest: defaultdict[Link, list[OldUse]] = defaultdict(list)
        """By link, the oldest value that was used, then the oldest one that was used later, and so on: ages fall."""
        self.heals: list[LinkHeal] = []
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
                DecidedTicks(agent, T_c, self.journal_ends)
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
