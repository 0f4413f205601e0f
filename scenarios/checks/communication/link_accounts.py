"""Accounts of what was sent over links, kept while a pass over a record goes on: what is missing, and since when."""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from math import inf, nextafter
from operator import attrgetter

from netem.ledger import LinkTrace
from scenarios.checks.communication.dropped_states import DroppedStates
from scenarios.checks.communication.neighbour_use import Uses
from scenarios.checks.communication.record_sink import Link, SentState
from scenarios.checks.communication.sent_states import SentStates
from scenarios.record.journal_coverage import Hole, inside
from wire.messages import PLANT

WAIT = 1000
"""Verdicts of an emulated link after which a state without one has none: a link judges what it gets at once."""

MOST_WAITING = 6000
"""Numbers of one link that are kept while they wait for their counterpart, or for the end of their process."""

OVERLAPPING = 64
"""Times in which processes of one agent were there, on either side of the place by its begin, among which that of a run
time is sought: a process that was frozen wakes beside the next one, and they may be out of order."""


@dataclass
class Missing:
    """States that are missing on a link."""

    count: int = 0
    """Number of them."""
    first: float = 0.0
    """Run time of the first one (s)."""

    def add(self, t: float) -> None:
        """Count one, of a run time (s)."""
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
        """Note a state."""
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


class VerdictAccounts:
    """Simulated time with emulated links: every state between the first and the last verdict of a link has one."""

    def __init__(self, sent: Mapping[str, SentStates]) -> None:
        self._sent = sent
        self._links: dict[Link, _Verdicts] = {}

    def trace(self, trace: LinkTrace) -> None:
        """Take verdicts of a link."""
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


@dataclass
class _Verdicts:
    """Verdicts of one link."""

    done: int
    """Number up to which all is decided."""
    highest: int = -1
    """Highest number with a verdict."""
    ahead: set[int] = field(default_factory=set)
    """Numbers with a verdict that are not decided yet."""
    missing: Missing = field(default_factory=Missing)


@dataclass
class Presence:
    """A time in which one process of an agent spoke with one session, without a long pause."""

    epoch: int
    """Its epoch."""
    since: float
    """Run time (s) of its first state."""
    until: float
    """Run time (s) of its last one."""


@dataclass
class ArrivalAccount:
    """Wall-clock time: what came over a link while both of its ends were there."""

    ends: tuple[Presence, Presence]
    """Sender and receiver."""
    began: bool = False
    """Whether the link must be there: something came, or both ends have been there for long."""
    early: Missing = field(default_factory=Missing)
    """States that did not come, of which only the number is kept."""
    late: dict[tuple[int, int], float] = field(default_factory=dict)
    """Run time (s) of the last ones, by epoch and number."""

    @property
    def since(self) -> float:
        """Run time (s) from which on both ends were there."""
        return max(end.since for end in self.ends)

    @property
    def until(self) -> float:
        """Run time (s) at which the first of both ends fell silent: what it sent then may not have left it."""
        return min(end.until for end in self.ends)


_since = attrgetter("since")


class ArrivalAccounts:
    """Wall-clock time: every state that was sent arrives, from the first one on that does, or that should have.

    Parameters
    ----------
    pause : float
        Silence of a process (s of run time) after which its links are given up, so that they have to be made anew.
    linked_within : float
        Time (s of run time) within which two processes that are both there have made their link.
    """

    def __init__(self, pause: float, linked_within: float) -> None:
        self._pause, self._linked_within = pause, linked_within
        self._there: dict[str, list[Presence]] = defaultdict(list)
        """When each agent was there, in the order of time."""
        self._states: dict[str, deque[SentState]] = defaultdict(deque)
        self._arrived: dict[Link, dict[tuple[int, int], None]] = {}
        self._dropped: dict[Link, deque[DroppedStates]] = defaultdict(lambda: deque(maxlen=WAIT))
        """Numbers of dropped states that receivers told, kept until every state that they may mean is known."""
        self._links_of: dict[str, list[Link]] = defaultdict(list)
        self._open: dict[Link, deque[ArrivalAccount]] = defaultdict(lambda: deque(maxlen=3))
        """The last accounts of each link: what comes later than others did is still missing there."""
        self.accounts: dict[Link, list[ArrivalAccount]] = {}
        """Accounts of each link."""

    def state(self, agent: str, state: SentState) -> None:
        """Note a state."""
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
        before, after = there[place], there[place + 1 :][:1]
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
        """Note that a state has arrived."""
        self.listens(link)
        for account in self._open[link]:
            if account.late and account.late.pop((epoch, number), None) is not None:
                return
        arrived = self._arrived[link]
        arrived[epoch, number] = None
        if len(arrived) > MOST_WAITING:
            del arrived[next(iter(arrived))]

    def dropped(self, link: Link, states: DroppedStates) -> None:
        """Note that a receiver dropped some states."""
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
            missing = [key for key, t in account.late.items() if dropped.since <= t <= dropped.until]
            for key in missing[:left]:
                del account.late[key]
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
                        _miss(account, key, state.t)

    def _at(self, agent: str, t: float, epoch: int | None = None) -> Presence | None:
        """Return the time in which an agent, or one process of it, was there at a run time (s)."""
        place = self._place(agent, t, epoch)
        return None if place is None else self._there[agent][place]

    def _place(self, agent: str, t: float, epoch: int | None = None) -> int | None:
        """Return the place of that time among those of the agent; a record may tell of a new session a state."""
        there = self._there[agent]
        after = bisect_right(there, t, key=_since)
        for i in range(min(len(there), after + OVERLAPPING) - 1, max(-1, after - 1 - OVERLAPPING), -1):
            one = there[i]
            if one.since <= t <= one.until and epoch in (None, one.epoch):
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


def _miss(account: ArrivalAccount, key: tuple[int, int], t: float) -> None:
    account.late[key] = t
    if len(account.late) > MOST_WAITING:
        oldest = next(iter(account.late))
        account.early.add(account.late.pop(oldest))
