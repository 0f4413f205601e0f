"""Accounts of links, kept while a pass over a record goes on: which of the sent states are missing."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from math import inf, nextafter

from gridpeers.lab.communication.sent_states import Link, SentState, SentStates, Uses
from gridpeers.scenarios.record.decision_entries import Hole, inside

MOST_WAITING = 6000
"""Numbers of one link that are kept while they wait for their counterpart, or for the end of their process."""

WAIT = 1000
"""Number of ticks for which it is kept which agents sent their neighbours a state."""


@dataclass
class Missing:
    count: int = 0
    first: float = 0.0

    def add(self, t: float) -> None:
        if not self.count:
            self.first = t
        self.count += 1


# -------------------------------------------------------------------- simulated time


class TickAccounts:
    """Simulated time without emulated links: every decision has the neighbours' states of the tick before."""

    def __init__(self, sent: Mapping[str, SentStates], T_c: float, lost: Sequence[Hole] = ()) -> None:
        self._sent, self._T_c, self._lost = sent, T_c, lost
        self._spoken: dict[int, set[str]] = {}
        self.missing: dict[Link, Missing] = {}

    def state(self, agent: str, state: SentState) -> None:
        if not (state.quiet or state.idle):
            if state.number not in self._spoken:
                self._spoken[state.number] = set()
                if len(self._spoken) > WAIT:
                    del self._spoken[next(iter(self._spoken))]
            self._spoken[state.number].add(agent)

    def use(self, agent: str, state: SentState, uses: Uses, *, new: bool) -> None:
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
            if newer or (invented and not inside(self._lost, (number or 0) * self._T_c)):
                self.missing[use.link].add(state.t)


# -------------------------------------------------------------------- real time


@dataclass
class Presence:
    """A time (s) in which one process of an agent spoke with one session, without a long pause."""

    epoch: int
    since: float
    until: float


@dataclass
class ArrivalAccount:
    ends: tuple[Presence, Presence]
    began: bool = False
    """The link must be there: something came, or both ends have been there for long."""
    missing: dict[tuple[int, int], float] = field(default_factory=dict)

    @property
    def since(self) -> float:
        return max(end.since for end in self.ends)

    @property
    def until(self) -> float:
        """Run time (s) at which the first of both ends fell silent: what it sent then may not have left it."""
        return min(end.until for end in self.ends)


class ArrivalAccounts:
    """Every state that was sent in real time arrives, from the first one on that does, or that should have.

    A process that is silent for a `pause` (s of run time) has its links given up, so that they have to be made anew;
    two processes that are both there have made theirs `linked_within` (s of run time).
    """

    def __init__(self, pause: float, linked_within: float) -> None:
        self._pause, self._linked_within = pause, linked_within
        self._there: dict[str, list[Presence]] = defaultdict(list)
        self._states: dict[str, deque[SentState]] = defaultdict(deque)
        self._arrived: dict[Link, dict[tuple[int, int], None]] = {}
        self._links_of: dict[str, list[Link]] = defaultdict(list)
        self.accounts: dict[Link, list[ArrivalAccount]] = {}

    def state(self, agent: str, state: SentState) -> None:
        there = self._there[agent]
        if not there or there[-1].epoch != state.epoch or state.t > there[-1].until + self._pause:
            there.append(Presence(state.epoch, state.t, state.t))
        there[-1].until = max(there[-1].until, state.t)
        if not state.quiet:
            self._states[agent].append(state)

    def renewed(self, agent: str, t: float) -> None:
        """Note that an agent opened a new session after its state of a run time (s): its links are made anew."""
        before = self._at(agent, t)
        if before is None:
            return
        there = self._there[agent]
        place = there.index(before)
        after = there[place + 1 : place + 2]
        if before.until == t and after and after[0].epoch == before.epoch:
            return  # a journal may come twice
        latest = takewhile(lambda state: state.t > t, reversed(self._states[agent]))
        later = [state.t for state in latest if state.epoch == before.epoch]
        there.insert(place + 1, Presence(before.epoch, min(later, default=nextafter(t, inf)), before.until))
        before.until = t

    def listens(self, link: Link) -> None:
        """Note that the receiver of a link has its sender for a neighbour, even if nothing comes."""
        if link not in self._arrived:
            self._arrived[link], self.accounts[link] = {}, []
            self._links_of[link[0]].append(link)

    def heard(self, link: Link, epoch: int, number: int) -> None:
        self.listens(link)
        for account in self.accounts[link][-3:]:  # one that others have overtaken is missing there
            if account.missing.pop((epoch, number), None) is not None:
                return
        arrived = self._arrived[link]
        arrived[epoch, number] = None
        if len(arrived) > MOST_WAITING:
            del arrived[next(iter(arrived))]

    def flush(self, until: float) -> None:
        for src, states in self._states.items():
            while states and states[0].t <= until:
                state = states.popleft()
                sender, key = self._at(src, state.t, state.epoch), (state.epoch, state.number)
                for link in self._links_of.get(src, ()):
                    arrived = self._arrived[link]
                    came = key in arrived
                    if came:
                        del arrived[key]
                    receiver = self._at(link[1], state.t)
                    if sender is None or receiver is None:
                        continue
                    account = self._account(link, sender, receiver)
                    account.began |= came or state.t > account.since + self._linked_within
                    if account.began and not came:
                        account.missing[key] = state.t

    def _at(self, agent: str, t: float, epoch: int | None = None) -> Presence | None:
        for there in reversed(self._there[agent]):
            if there.since <= t <= there.until and epoch in (None, there.epoch):
                return there
        return None

    def _account(self, link: Link, sender: Presence, receiver: Presence) -> ArrivalAccount:
        for account in reversed(self.accounts[link][-3:]):
            if account.ends[0] is sender and account.ends[1] is receiver:
                return account
        account = ArrivalAccount((sender, receiver))
        self.accounts[link].append(account)
        return account
