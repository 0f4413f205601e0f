"""Reports to the recorders of a run: published, kept, and published again for one that missed them. Pure.

In simulated time it is kept until the recorders that the run waits for have acknowledged it, and the plant holds its
next tick while much is not acknowledged. In real time the plant keeps the latest telemetry, acknowledged or not.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from itertools import takewhile
from math import inf

from gridpeers.plant.plant_stepper import PlantStepper
from gridpeers.wire.codec import encode
from gridpeers.wire.links import Links
from gridpeers.wire.messages import AnyMessage, Pacing
from gridpeers.wire.node import Publish
from gridpeers.wire.post import Post

KEPT_BYTES, KEPT_BYTES_RECORDED = 4_000_000, 40_000_000
"""Bytes that are kept in real time, without and with journals: two minutes of nine inverters."""

WINDOW = 1_000_000
"""Bytes without acknowledgement beyond which the plant waits before its next tick: an unread loopback link holds
as many, so Zenoh does not close it before."""

BLOCK = 1 << 20
"""Bytes of a block of kept messages: kept one by one, they leave the heap full of holes (40 MB in a live run)."""

AT_ONCE = 20  # messages that are published again in one control period, so that the plant keeps its pace
TELEMETRY = 0.2  # time (s, real time) between two telemetry messages in real time
SILENT = 3.0  # time (s) after a recorder's last question after which it counts as silent; it asks every second


class RecorderFeed:
    """The messages on the key of telemetry, in their order, and the recorders that the run waits for.

    Each has the number of a Telemetry: its own, or that of the next one for a message between two of them. While
    messages are published again, new ones wait for their turn: a recorder gets all in order.

    `limit`: bytes to keep; None: what is kept stays until all recorders have acknowledged it.
    """

    def __init__(self, recorders: Iterable[str], publish: Callable[[bytes], None], limit: int | None = None) -> None:
        self._publish, self._limit = publish, limit
        self._needs = dict.fromkeys(recorders, 0)  # number of the Telemetry that each recorder needs next
        self._asked_at = dict.fromkeys(self._needs, -inf)
        self._kept: deque[tuple[int, memoryview]] = deque()
        self._due: deque[tuple[int, memoryview]] = deque()
        self._room = memoryview(bytearray())  # what is left of the last block
        self._bytes = 0
        self.paced = False  # whether `replay` publishes a little in each period; else all goes at once

    @property
    def is_full(self) -> bool:
        """Whether the next tick must wait for an acknowledgement."""
        return self._limit is None and self._bytes > WINDOW

    def serves(self, present: Iterable[str]) -> bool:
        """Return whether a recorder still needs the plant: in simulated time until it has acknowledged all."""
        return bool(self._kept) if self._limit is None else not self._needs.keys().isdisjoint(present)

    def is_silent(self, now: float) -> bool:
        """Return whether a recorder has not asked for a while; its process also starts the agents."""
        return any(now > at + SILENT for at in self._asked_at.values())

    def publish(self, number: int, payload: bytes) -> None:
        """Publish and keep a message of this number; it waits if others before it are published again."""
        if self._limit is None and not self._needs:
            self._publish(payload)
            return
        self._keep(number, payload)
        while self._limit is not None and self._bytes > self._limit and self._kept[0][0] < number:
            self._drop_before(self._kept[0][0] + 1)
        if not self._due:
            self._publish(payload)
            return
        self._due.append(self._kept[-1])
        if not self.paced:
            self.replay()

    def others(self, number: int) -> int:
        """Return the number of messages that count to a Telemetry that is yet to be published."""
        return sum(1 for _ in takewhile(lambda message: message[0] == number, reversed(self._kept)))

    def acknowledged(self, recorder: str, number: int, now: float) -> bool:
        """Note that a recorder has all before a number; return whether that is news."""
        news, self._asked_at[recorder] = number > self._needs[recorder], now
        self._needs[recorder] = max(number, self._needs[recorder])
        self._drop_before(min(self._needs.values()))
        return news

    def again_from(self, number: int) -> int:
        """Have messages from a number on published again; return the first number that is still kept."""
        start = min(number, self._due[0][0]) if self._due else number
        self._due = deque(entry for entry in self._kept if entry[0] >= start)
        return max(number, self._kept[0][0]) if self._kept else number

    def replay(self) -> None:
        for _ in range(min(AT_ONCE, len(self._due)) if self.paced else len(self._due)):
            self._publish(bytes(self._due.popleft()[1]))

    def end(self) -> None:
        self.paced = False
        self.replay()

    def _keep(self, number: int, payload: bytes) -> None:
        size = len(payload)
        if size > len(self._room):
            self._room = memoryview(bytearray(max(BLOCK, size)))
        self._room[:size] = payload
        self._kept.append((number, self._room[:size]))
        self._room = self._room[size:]
        self._bytes += size

    def _drop_before(self, number: int) -> None:
        while self._kept and self._kept[0][0] < number:
            self._bytes -= len(self._kept.popleft()[1])


class RunReports:
    """`every`: ticks between two telemetry messages, and between two accounts of links; `live`: see `regular`."""

    def __init__(
        self, post: Post, stepper: PlantStepper, feed: RecorderFeed, every: tuple[int, int], *, live: bool
    ) -> None:
        self.pacing: Callable[[], Pacing | None] = lambda: None
        self.impaired: Callable[[], tuple[str, ...]] = tuple
        self.omitted: Callable[[], list[str]] = list  # takes out lines on the warnings that came too often
        self._post, self._stepper, self._feed = post, stepper, feed
        self._every, self._links_every = every
        self._live = live
        self._next_events = -inf  # until then (s) events wait for the next telemetry: they must not be a flood
        self.last_due = False  # whether the run has ended and the last telemetry is still to be sent

    def publish(self, payload: bytes) -> None:
        """Publish a message for recorders, and keep it for those that miss it."""
        self._feed.publish(self._stepper.telemetry_number, payload)

    def publish_aside(self, key: str, message: AnyMessage) -> None:
        """Publish what depends on the time that others take: in simulated time the record is without it."""
        if self._live:
            self._post.send(key, message)
        else:
            self._post.actions.append(Publish(key, encode(message)))

    def telemetry(self, *, final: bool = False, awaited: tuple[str, ...] = ()) -> None:
        """Publish all rows and events since the last telemetry; `awaited`: agents to start."""
        others = self._feed.others(self._stepper.telemetry_number)
        pacing, impaired = self.pacing(), self.impaired()
        report = self._stepper.report(final=final, awaited=awaited, pacing=pacing, impaired=impaired, others=others)
        for message in report:
            self.publish(encode(message))

    def regular(self, now: float, links: Links | None) -> None:
        """Publish what is due after this tick; in a live run also the first row, and events, at once."""
        tick = self._stepper.tick
        due = tick % self._every == 0
        if self._live and not due:
            due = tick == 1
            if not due and self._stepper.has_events and now >= self._next_events:
                due, self._next_events = True, now + TELEMETRY
        if due:
            self.telemetry()
            self._journal()
        if tick % self._links_every == 0:
            self._accounts(links)

    def last(self, links: Links | None) -> None:
        """Publish the last reports, if they are due."""
        if self.last_due:
            self.last_due = False
            self._journal()
            self._accounts(links, last=True)
            self.telemetry(final=True)

    def _journal(self) -> None:
        for part in self._post.take_journal(self._stepper.t):
            self.publish(encode(part))

    def _accounts(self, links: Links | None, *, last: bool = False) -> None:
        for report in self._post.take_link_reports(links, t=self._stepper.t, last=last):
            self.publish(encode(report))
