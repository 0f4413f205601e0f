"""All links into one receiver: messages are judged, delayed, and handed out when they are due. Pure.

A driver calls `offer` for each message that has come and `due` when the time is; both take times as arguments (s of run
time). `until` says when the next message is due, so that a driver in real time can sleep until then.
"""

from __future__ import annotations

from collections.abc import Mapping
from heapq import heapify, heappop, heappush
from typing import NamedTuple
from zlib import crc32

from gridpeers.netem.channel import FOREVER, NEVER, Channel
from gridpeers.netem.fault_schedule import Change, changed, schedule_of
from gridpeers.netem.ledger import BATCH, Ledger, LinkCounts, LinkTrace, Outcome, combined
from gridpeers.netem.models import INSTANT
from gridpeers.netem.models.medium import flip
from gridpeers.netem.schema.fault import Span
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.pattern import Link
from gridpeers.wire.links import Arrival
from gridpeers.wire.messages import AnyMessage

MOST_FAILURES = 8  # User-defined faults that failed and are named in one report, which must not become too long

NANO = 1e9
"""Arrivals are ordered by whole nanoseconds: so t_k + d and t_j meet where their decimals do, whatever binary does."""


AT_ONCE: tuple[tuple[float, int | None], ...] = ((0.0, None),)  # Deliveries of a link without faults


class _Special(NamedTuple):
    copy: int
    bit: int | None
    checksum: bool
    t: float
    at: float
    held_until: float


_Content = tuple[bytes, AnyMessage | None]

_Waiting = tuple[float, int, str, int, _Content, float, _Special | None]
"""A copy of a message on its way: when it arrives (ns of run time), its number and sender, a number of its own so that
no two are compared further, the message, its delay (s). A plain tuple, as it is made for every message."""


class _Inbound:
    __slots__ = ("begins", "channel", "due", "is_clear", "ledger", "story")

    def __init__(self, channel: Channel, *, keep: bool) -> None:
        self.channel, self.is_clear = channel, channel.is_clear
        self.ledger = Ledger(keep=keep)
        self.story = self.due = NEVER
        """Latest arrival so far, as netem has it (s), and as it is (ns)."""
        self.begins = channel.schedule.begins
        """When the first fault of the link begins (s of run time)."""


class Receiver:
    """All links into one receiver, an inverter or the plant.

    Microgrids are in the order of the inverters' table; `meet` adds others. Without `keep_trace` only the hash of the
    verdicts is kept.

    Examples
    --------
    >>> from gridpeers.netem.schema.fault import Fault
    >>> netem = Netem(links=(Fault(on="inv1 -> inv2", delay=0.25),))
    >>> receiver = Receiver("inv2", netem, {"inv1": "MG1", "inv2": "MG1"})
    >>> receiver.offer("inv1", seq=0, t=0.0, at=0.0, payload=b"state")
    >>> receiver.until, receiver.due(0.2), receiver.due(0.25)
    (0.25, [], [Arrival(src='inv1', payload=b'state', delay=0.25, message=None)])
    """

    def __init__(self, name: str, netem: Netem, microgrids: Mapping[str, str], *, keep_trace: bool = True) -> None:
        self.name = name
        self._netem, self._microgrids, self._keep = netem, dict(microgrids), keep_trace
        self.changes: list[Change] = []
        self._links: dict[str, _Inbound] = {}
        self._heap: list[_Waiting] = []
        self._kept: list[_Waiting] = []
        self._number = 0

    def meet(self, src: str, microgrid: str) -> None:
        """Learn the microgrid of a sender before its first message."""
        self._microgrids.setdefault(src, microgrid)

    def touched(self, src: str) -> bool:
        """Return whether a fault may ever act on the link from a sender; if not, its messages need not come here."""
        inbound = self._links.get(src) or self._link(src)
        return not inbound.is_clear

    def holding(self, src: str, t: float) -> dict[str, Span]:
        """Return the faults that act on messages that a sender sends at t (s of run time), by kind."""
        channel = self._link(src).channel
        return {} if channel.is_clear else channel.schedule.at(t).active

    def was_impaired(self, src: str, t: float) -> bool:
        """Return whether the link from a sender has had a fault by t (s of run time), the present one included."""
        return self._link(src).begins <= t + INSTANT

    def offer(self, src: str, seq: int, t: float, at: float, payload: bytes, message: AnyMessage | None = None) -> None:
        """Judge a message, sent at `t` (s of run time) and here without faults at `at` (s, on the receiver's clock).

        `due` hands on the decoded `message` where there is one, so that nobody decodes it again. Messages that the
        faults leave in order stay so: the way to this process, part of `at` in real time, never makes one message
        overtake another.
        """
        inbound = self._links.get(src) or self._link(src)
        ledger, content = inbound.ledger, (payload, message)
        ledger.sent += 1
        if inbound.is_clear:
            deliveries, held_until, checksum = AT_ONCE, NEVER, False
        else:
            deliveries, reason, held_until = inbound.channel.judge(seq, t, len(payload))
            checksum = inbound.channel.checksum
            outcome: Outcome = reason
            if not deliveries:
                ledger.dropped[reason] += 1
            elif len(deliveries) == 1 and deliveries[0][1] is None:
                outcome = deliveries[0][0]
            else:
                ledger.duplicated += len(deliveries) - 1
                outcome = deliveries
            ledger.new.append((seq, t, outcome))
            if len(ledger.new) >= BATCH:
                ledger.fold()
        copy = 0
        for delay, bit in deliveries:
            plain = copy == 0 and bit is None and held_until == NEVER
            special = None if plain else _Special(copy, bit, checksum, t, at, held_until)
            self._number += 1
            if delay == FOREVER:
                self._kept.append((FOREVER, seq, src, self._number, content, delay, special))
            else:
                due: float = round((at + delay) * NANO)
                story = t + delay
                if copy == 0 and story >= inbound.story:
                    if due < inbound.due:
                        due = inbound.due
                    inbound.story, inbound.due = story, due
                heappush(self._heap, (due, seq, src, self._number, content, delay, special))
            copy += 1  # noqa: SIM113  enumerate costs a tenth of a message

    def due(self, now: float) -> list[Arrival]:
        """Return the messages that have arrived by `now` (s of run time), by arrival, then number and sender."""
        heap = self._heap
        if not heap:
            return []
        limit, arrived = round(now * NANO), []
        while heap and heap[0][0] <= limit:
            _, _, src, _, (payload, message), delay, special = heappop(heap)
            ledger = self._links[src].ledger
            if special is not None and special.bit is not None:
                ledger.corrupted += 1
                sound, payload, message = payload, flip(payload, special.bit), None
                if special.checksum and crc32(payload) != crc32(sound):
                    ledger.dropped["checksum"] += 1
                    continue
            ledger.delivered += 1
            arrived.append(Arrival(src, payload, delay, message))
        return arrived

    @property
    def until(self) -> float | None:
        """When the next message is due (s of run time), None if none is."""
        return self._heap[0][0] / NANO if self._heap else None

    # ---------------------------------------------------------------- live

    def apply(self, change: Change) -> tuple[str, ...]:
        """Change links for messages sent at `change.from_s` (s of run time) or later; kept messages are judged anew.

        Faults that were over long ago are forgotten, unless the link has messages that a cut keeps: they may be of that
        time. Returns the senders so far whose links it changes.
        """
        self.changes.append(change)
        concerned = list[str]()
        for src, inbound in self._links.items():
            channel = inbound.channel
            schedule = changed(channel.schedule, change, channel.link, self._microgrids)
            if schedule is not channel.schedule:
                concerned.append(src)
                kept = self._take_kept(src, change.from_s)
                inbound.begins = min(inbound.begins, schedule.begins)
                channel.reschedule(schedule if kept else schedule.lately(change.from_s), rewind=bool(kept))
                inbound.is_clear = False  # what is judged anew is noted, by a link without faults too
                inbound.ledger.sent -= len(kept)
                for seq, content, special in kept:
                    self.offer(src, seq, special.t, special.at, *content)
                inbound.is_clear = channel.is_clear
        return tuple(concerned)

    def _take_kept(self, src: str, t: float) -> list[tuple[int, _Content, _Special]]:
        """Take back the messages that a cut keeps beyond t, to be judged anew: number, message and times."""
        found = []
        for waiting in (self._heap, self._kept):
            for entry in sorted(waiting):
                _, seq, sender, _, content, _, special = entry
                if sender == src and special is not None and special.held_until > t:
                    waiting.remove(entry)
                    if special.copy:
                        self._links[src].ledger.duplicated -= 1
                    else:
                        found.append((seq, content, special))
        heapify(self._heap)
        if found:
            self._links[src].story = self._links[src].due = NEVER
        return sorted(found, key=lambda entry: entry[2].t)

    # ---------------------------------------------------------------- for reports

    @property
    def dropped(self) -> int:
        return sum(sum(inbound.ledger.dropped.values()) for inbound in self._links.values())

    def counts(self) -> dict[str, LinkCounts]:
        flying = [entry[2] for entry in (*self._heap, *self._kept)]
        return {src: inbound.ledger.counts(flying.count(src)) for src, inbound in sorted(self._links.items())}

    def take_trace(self) -> tuple[LinkTrace, ...]:
        """Return the verdicts since the last call, by sender; links without a fault have none."""
        found = (inbound.ledger.take(src, self.name) for src, inbound in sorted(self._links.items()))
        return tuple(trace for trace in found if trace is not None)

    def take_failures(self) -> tuple[str, ...]:
        """Return sentences since the last call on user-defined faults that failed."""
        found = [text for _, inbound in sorted(self._links.items()) for text in inbound.channel.failures]
        for inbound in self._links.values():
            inbound.channel.failures.clear()
        more = len(found) - MOST_FAILURES
        return (*found[:MOST_FAILURES], *([f"{more} more faults of links into {self.name} failed"] if more > 0 else []))

    @property
    def trace_sha256(self) -> str:
        """Hash (hex) of all verdicts so far: the same in every process in which the same messages were judged."""
        digests = ((src, inbound.ledger.digest().hex()) for src, inbound in self._links.items())
        return combined((src, digest) for src, digest in digests if digest)

    # ---------------------------------------------------------------- inside

    def _link(self, src: str) -> _Inbound:
        inbound = self._links.get(src)
        if inbound is None:
            link = Link(src, self.name)
            schedule = schedule_of(link, self._netem, self.changes, self._microgrids)
            inbound = _Inbound(Channel(link, schedule.spans, self._netem.seed), keep=self._keep)
            self._links[src] = inbound
        return inbound
