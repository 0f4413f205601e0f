"""Accounts of what arrives over links in real time, kept while a pass over a record goes on."""

from __future__ import annotations

from collections import defaultdict, deque
from dataclasses import dataclass, field
from itertools import takewhile
from math import inf, nextafter

from gridpeers.lab.communication.record_pass import DroppedStates, Link
from gridpeers.lab.communication.sent_states import SentState

MOST_WAITING = 6000
"""Numbers of one link that are kept while they wait for their counterpart, or for the end of their process."""

MOST_DROPPED = 1000
"""Numbers of dropped states of one link that are kept until every state that they may mean is known."""


@dataclass
class Presence:
    """A time (s) in which one process of an agent spoke with one session, without a long pause."""

    epoch: int
    since: float
    until: float


@dataclass
class ArrivalAccount:
    """What came over a link while its sender and its receiver were there."""

    ends: tuple[Presence, Presence]
    began: bool = False
    """Whether the link must be there: something came, or both ends have been there for long."""
    missing: dict[tuple[int, int], float] = field(default_factory=dict)
    """Run time (s) of the states that did not come, by epoch and number."""

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
        """When each agent was there, in the order of time."""
        self._states: dict[str, deque[SentState]] = defaultdict(deque)
        self._arrived: dict[Link, dict[tuple[int, int], None]] = {}
        self._dropped: dict[Link, deque[DroppedStates]] = defaultdict(lambda: deque(maxlen=MOST_DROPPED))
        self._links_of: dict[str, list[Link]] = defaultdict(list)
        self._open: dict[Link, deque[ArrivalAccount]] = defaultdict(lambda: deque(maxlen=3))
        """The last accounts of each link: what comes later than others did is still missing there."""
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
        there = self._there[agent]
        place = self._place(agent, t)
        if place is None:
            return
        before, after = there[place], there[place + 1 : place + 2]
        if before.until == t and after and after[0].epoch == before.epoch:
            return  # it is told twice
        latest = takewhile(lambda state: state.t > t, reversed(self._states[agent]))
        later = [state.t for state in latest if state.epoch == before.epoch]
        there.insert(place + 1, Presence(before.epoch, min(later, default=nextafter(t, inf)), before.until))
        before.until = t

    def listens(self, link: Link) -> None:
        """Note that the receiver of a link has its sender for a neighbour, whether anything comes or not."""
        if link not in self._arrived:
            self._arrived[link], self.accounts[link] = {}, []
            self._links_of[link[0]].append(link)

    def heard(self, link: Link, epoch: int, number: int) -> None:
        self.listens(link)
        for account in self._open[link]:
            if account.missing and account.missing.pop((epoch, number), None) is not None:
                return
        arrived = self._arrived[link]
        arrived[epoch, number] = None
        if len(arrived) > MOST_WAITING:
            del arrived[next(iter(arrived))]

    def dropped(self, link: Link, states: DroppedStates) -> None:
        self.listens(link)
        self._dropped[link].append(states)

    def flush(self, until: float) -> None:
        """Close the accounts of what was sent up to a run time (s), as far as it has come, or was dropped."""
        self._close(until)
        for link, dropped in self._dropped.items():
            while dropped and dropped[0].until <= until:
                self._excuse(link, dropped.popleft())

    def _excuse(self, link: Link, dropped: DroppedStates) -> None:
        """Take as many states that are missing off the accounts as were dropped, the oldest first."""
        left = dropped.number
        for account in self._open[link]:
            missing = [key for key, t in account.missing.items() if dropped.since <= t <= dropped.until]
            for key in missing[:left]:
                del account.missing[key]
            left -= min(left, len(missing))

    def _close(self, until: float) -> None:
        for src, states in self._states.items():
            links = self._links_of.get(src, ())
            while states and states[0].t <= until:
                state = states.popleft()
                sender = self._at(src, state.t, state.epoch)
                key = state.epoch, state.number
                for link in links:
                    arrived = self._arrived[link]
                    came = key in arrived
                    if came:
                        del arrived[key]
                    receiver = self._at(link[1], state.t)
                    if sender is None or receiver is None:
                        continue
                    account = self._account(link, (sender, receiver))
                    if came or state.t > account.since + self._linked_within:
                        account.began = True
                    if account.began and not came:
                        account.missing[key] = state.t

    def _at(self, agent: str, t: float, epoch: int | None = None) -> Presence | None:
        """Return the time in which an agent, or one process of it, was there at a run time (s)."""
        place = self._place(agent, t, epoch)
        return None if place is None else self._there[agent][place]

    def _place(self, agent: str, t: float, epoch: int | None = None) -> int | None:
        """Return the place of that time among those of the agent; a record may tell of a new session a state."""
        there = self._there[agent]
        for i in reversed(range(len(there))):
            if there[i].since <= t <= there[i].until and epoch in (None, there[i].epoch):
                return i
        return None

    def _account(self, link: Link, ends: tuple[Presence, Presence]) -> ArrivalAccount:
        for account in reversed(self._open[link]):
            if account.ends[0] is ends[0] and account.ends[1] is ends[1]:
                return account
        account = ArrivalAccount(ends)
        self.accounts[link].append(account)
        self._open[link].append(account)
        return account
