"""Accounts of links, kept while a pass over a record goes on: which of the sent states are missing."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import permutations, takewhile
from math import inf, nextafter

from gridpeers.lab.communication.sent_states import Link, SentState, SentStates, StateWindow, Uses
from gridpeers.netem.ledger import LinkTrace
from gridpeers.netem.schema.fault import Span
from gridpeers.netem.schema.pattern import Link as LinkEnds
from gridpeers.scenarios.record.record_info import RecordInfo

MOST_WAITING = 6000
"""Numbers of one link that are kept while they wait for their counterpart, or for the end of their process."""

WAIT = 1000  # Number of ticks for which it is kept which agents sent their neighbours a state


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

    def __init__(self, sent: Mapping[str, SentStates]) -> None:
        self._sent = sent
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
            if newer or invented:
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


# -------------------------------------------------------------------- heals


CUTS = ("cut", "partition")  # Faults with an end, and reasons of dropped messages, that part two agents
LOSSES = (*CUTS, "loss", "flap")  # Faults during which a link that was cut does not count as whole again

STANDSTILL, PERIODS = 0.5, 5.0
"""Real time: an agent that decides nothing for so long (s of run time), and for so many control periods, stood
still. Its numbers have no gap then. Shorter pauses are those of a busy host, and count as work."""


@dataclass
class LinkHeal:
    link: Link
    t: float
    took: float | None = None
    """After what time (s) the receiver used something that the sender has sent since; None if it never did. It counts
    from when one of them last stood still (left out ticks; in real time `STANDSTILL`), if that was later."""
    lost_again: float = inf
    """When (s) the link was next cut, or began to lose messages."""
    at_work_since: float | None = None
    """Since when (s) the receiver has been at work without standing still, if the sender was there and has spoken since
    the heal. In simulated time the sender has left out no tick since, either; in real time one that stands still
    is there until its last state."""
    waited: float = 0.0
    """Longest time (s) of that kind in which the link was whole and nothing new was used."""


class Heals:
    """The heals of all links over which agents listen up to t_end (s): planned ones, and those that verdicts show."""

    def __init__(self, info: RecordInfo, t_end: float, sent: Mapping[str, SentStates]) -> None:
        self._sent, self._simulated = sent, info.simulated
        self._standstill = inf if info.simulated else max(STANDSTILL, PERIODS * info.T_c)
        """Time (s) between states of successive numbers in which an agent stood still; simulated time has a gap."""
        self._healed: dict[Link, list[LinkHeal]] = defaultdict(list)
        self._open: dict[str, list[LinkHeal]] = defaultdict(list)
        """Those after which nothing new has been used yet, by receiver."""
        self._was_cut: set[Link] = set()
        self._listens: set[Link] = set()
        self._losses: dict[Link, list[Span]] = {}
        """Planned cuts and losses of each link."""
        if setup := info.emulation:
            for link in permutations(info.agent_names, 2):
                spans = setup.netem.spans(LinkEnds(*link), setup.microgrids)
                self._losses[link] = [span for span in spans if span.kind in LOSSES]
                for t, again in _ends(self._losses[link]):
                    if t < t_end:
                        self._add(LinkHeal(link, t, lost_again=again))

    def trace(self, trace: LinkTrace) -> None:
        link = trace.src, trace.dst
        for t, outcome in zip(trace.t, trace.outcome, strict=True):
            if outcome in CUTS:
                self._was_cut.add(link)
                for heal in self._healed.get(link, ()):
                    if heal.t < t:
                        heal.lost_again = min(heal.lost_again, t)
            elif link in self._was_cut and not isinstance(outcome, str) and not self._is_lossy(link, t):
                self._was_cut.discard(link)
                self._add(LinkHeal(link, t))

    def use(self, agent: str, state: SentState, uses: Uses, *, new: bool) -> None:
        if new:
            self._listens.update(use.link for use in uses.each)
        waiting = [heal for heal in self._open.get(agent, ()) if heal.t <= state.t and heal.link in self._listens]
        if not waiting:
            return
        number = {use.link: use.number_at(state.number) for use in uses.each if use.unused not in ("silent", "stale")}
        for heal in waiting:
            used = number.get(heal.link)
            src, dst = (self._sent[name].window_at(state.t) for name in heal.link)
            sent_at = None if used is None else src.t(used)
            if used is not None and sent_at is not None and sent_at >= heal.t - 1e-9:
                begins = max(
                    _at_work_since(src, used, heal.t, self._standstill),
                    _at_work_since(dst, state.number, heal.t, self._standstill),
                )
                heal.took = max(0.0, state.t - begins)
            else:
                self._note_work(heal, state, src, dst)
        self._open[agent] = [heal for heal in self._open[agent] if heal.took is None and state.t <= heal.lost_again]

    def _note_work(self, heal: LinkHeal, state: SentState, src: StateWindow, dst: StateWindow) -> None:
        """Note for how long both have been at work, with an own state of the receiver that uses nothing new."""
        number, goes_on = state.number, _goes_on(dst, state.number, self._standstill)
        if self._simulated:  # numbers are ticks, so that pauses of the sender show, and states that it kept to itself
            speaks, works = src.spoke(number - 1), src.decided(number - 1)
        else:
            sender = self._sent[heal.link[0]]
            speaks = sender.spoke_at >= heal.t
            works = any(first <= state.t <= last for first, last in sender.epochs.values())
        if not works:
            heal.at_work_since = None
        elif heal.at_work_since is None or not goes_on:
            before = (dst.t(number - 1) or 0.0) if goes_on else inf
            heal.at_work_since = (heal.t if before <= heal.t else state.t) if speaks else None
        if heal.at_work_since is not None:
            heal.waited = max(heal.waited, min(state.t, heal.lost_again) - heal.at_work_since)

    def _is_lossy(self, link: Link, t: float) -> bool:
        return any(span.from_s - 1e-9 <= t < span.to_s - 1e-9 for span in self._losses.get(link, ()))

    def found(self) -> list[LinkHeal]:
        """Return the heals of links over which an agent listens, in the order of links and time."""
        return [heal for link in sorted(self._listens) for heal in sorted(self._healed[link], key=lambda one: one.t)]

    def _add(self, heal: LinkHeal) -> None:
        if all(abs(known.t - heal.t) > 5e-4 for known in self._healed[heal.link]):
            self._healed[heal.link].append(heal)
            self._open[heal.link[1]].append(heal)


def _goes_on(window: StateWindow, number: int, standstill: float) -> bool:
    """Return whether an agent decided the state before the one of a number, and did not stand still (s) in between."""
    before, now = window.t(number - 1), window.t(number)
    return window.decided(number - 1) and before is not None and (now is None or now - before < standstill)


def _at_work_since(window: StateWindow, number: int, t: float, standstill: float) -> float:
    """Return since when (s), from a time on, an agent has decided without standing still (s) up to a number."""
    while _goes_on(window, number, standstill) and (window.t(number - 1) or 0.0) >= t - 1e-9:
        number -= 1
    return max(t, window.t(number) or 0.0)


def _ends(spans: Iterable[Span]) -> Iterator[tuple[float, float]]:
    """Yield when (s) a link is whole again, and until when: cuts may overlap, and losses may go on after one."""
    until, was_cut = -inf, False
    for span in sorted(spans, key=lambda it: it.from_s):
        if span.from_s > until:
            if was_cut:
                yield until, span.from_s
            was_cut = False
        until, was_cut = max(until, span.to_s), was_cut or span.kind in CUTS
    if was_cut:
        yield until, inf
