"""The queue of events for the one thread that owns the core, and what may wait in it.

Should the owner fall behind, or somebody send faster than it reads, then

- up to `ROOM` messages wait, and beyond that `MOST_OF_ONE` on each key: a flood on one key never displaces a state, a
  measurement or a stop request on another. Who may send on a key is the business of access rules;
- messages above `SMALL` bytes have `BYTES` together;
- tokens always wait: Zenoh keeps each in every process anyway.
"""

from __future__ import annotations

from _thread import allocate_lock
from collections import Counter, deque
from contextlib import suppress
from time import monotonic
from typing import Literal

from gridpeers.wire.messages import LONGEST_MESSAGE
from gridpeers.wire.node import Loss

Kind = Literal["message", "appeared", "vanished", "word"]
"""A message or answer; a token that appeared or vanished; or a word from another thread of the own process."""

Event = tuple[Kind, str, bytes]  # Kind, key and payload

Stamped = tuple[Kind, str, bytes, float]  # The same, and its time of arrival (s, monotonic): it may wait for its owner

ROOM = 4_000  # Messages that may wait, on any keys: four for each of the most inverters in a run
SMALL = 4_096  # Bytes of a short message; the longer ones are reports, journals and telemetry
MOST_OF_ONE = 64  # Messages that may wait beyond `ROOM` on one key: more than a second of a sender's states
BYTES = 64_000_000  # Bytes of long messages that may wait
LOSSLESS = 8  # Factor on these limits in simulated time: honest senders send less before they have an answer


class Inbox:
    """Queue events from Zenoh's threads to the owner's.

    The owner states how many messages it needs to continue, and wakes only then: in a full mesh of nine this halves the
    time of a tick. Any other event wakes it at once. `lossless` is for simulated time, where no message may be lost.
    """

    def __init__(self, *, lossless: bool = False) -> None:
        self._factor = LOSSLESS if lossless else 1
        self._events: deque[Stamped] = deque()
        self._needed = 1
        self._urgent = False
        self._wake = allocate_lock()
        self._wake.acquire()
        self._guard = allocate_lock()
        """Held while any of the following is read or changed, and while what it admits is put in."""
        self._counted = False
        """Whether any of the next two is to be set to zero once nothing waits."""
        self._beyond: Counter[str] = Counter()
        """Messages that wait beyond `ROOM`, by key."""
        self._bytes = 0
        """Bytes of the long messages that wait."""
        self._losses: dict[tuple[str, str], Loss] = {}

    def put(self, event: Event, *, asked: bool = False) -> None:
        """Put an event in, from any thread; drop and count a message for which there is no room.

        An answer to an own question (`asked`) may have any length.
        """
        kind, _, payload = event
        if kind == "message" and len(self._events) < ROOM and len(payload) <= SMALL:
            self._events.append((*event, monotonic()))
        elif kind == "message":
            self._put_if_admitted(event, asked=asked)
        else:
            self._events.append((*event, monotonic()))
            self._urgent = True  # before the wake: `take` forgets one that comes while the owner computes
        if self._urgent or len(self._events) >= self._needed:
            with suppress(RuntimeError):  # awake already
                self._wake.release()

    def _put_if_admitted(self, event: Event, *, asked: bool) -> None:
        _, key, payload = event
        size = len(payload)
        long = size if size > SMALL else 0
        with self._guard:
            waiting = len(self._events)
            if size > LONGEST_MESSAGE and not asked:
                self._lose(key, "oversized", f"{size} bytes, at most {LONGEST_MESSAGE} are allowed")
                return
            beyond = waiting >= ROOM * self._factor
            full = beyond and self._beyond[key] >= MOST_OF_ONE * self._factor
            if full or (long and self._bytes + long > BYTES * self._factor):
                self._lose(key, "excess", f"{waiting} messages were waiting, {self._bytes} bytes of them in long ones")
                return
            self._counted = True  # before it is put in: `take` looks for it afterwards
            self._beyond[key] += beyond
            self._bytes += long
            self._events.append((*event, monotonic()))

    def _lose(self, key: str, kind: str, text: str) -> None:
        """Count a message that is dropped unread; the guard is held."""
        first = self._losses.get((key, kind))
        self._losses[key, kind] = Loss(key, kind, text, 1) if first is None else first._replace(number=first.number + 1)

    def take_losses(self) -> tuple[Loss, ...]:
        if not self._losses:
            return ()
        with self._guard:
            losses, self._losses = tuple(self._losses.values()), {}
            return losses

    def take(self, needed: int, timeout: float | None) -> list[Stamped]:
        """Take all events out, in order, once so many messages or any other event wait, or the timeout (s) is over.

        There may be fewer than needed, or, rarely, none before the timeout.
        """
        events = self._events
        self._wake.acquire(blocking=False)  # forget an old wake
        self._needed = needed
        if len(events) < needed and not self._urgent:
            self._wake.acquire(timeout=-1.0 if timeout is None else timeout)
        self._urgent = False
        taken = []
        while events:
            taken.append(events.popleft())
        if self._counted:
            with self._guard:
                while events:  # none that is counted waits any more
                    taken.append(events.popleft())
                self._counted, self._bytes = False, 0
                self._beyond.clear()
        return taken
