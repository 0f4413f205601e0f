"""The queue of events for the one thread that owns the core."""

from __future__ import annotations

from _thread import allocate_lock
from collections import deque
from contextlib import suppress
from time import monotonic
from typing import Literal

Kind = Literal["message", "appeared", "vanished", "word"]
"""A message or answer; a token that appeared or vanished; or a word from another thread of the own process."""

Event = tuple[Kind, str, bytes]
"""Kind, key and payload."""

Stamped = tuple[Kind, str, bytes, float]
"""The same with its time of arrival (s, monotonic): it may wait here for its owner."""


class Inbox:
    """Queue events from Zenoh's threads to the owner's thread.

    The owner states how many messages it needs to continue, and wakes only then: in a full mesh of nine
    this is one wake a tick instead of nine, and half of the time of a tick. Any other event wakes it at once.

    Examples
    --------
    >>> inbox = Inbox()
    >>> inbox.put(("message", "a", b"1"))
    >>> [event[:3] for event in inbox.take(1, timeout=0.0)]
    [('message', 'a', b'1')]
    >>> inbox.take(1, timeout=0.0)
    []
    """

    def __init__(self) -> None:
        self._events: deque[Stamped] = deque()
        self._needed = 1
        self._urgent = False
        self._wake = allocate_lock()
        self._wake.acquire()

    def put(self, event: Event) -> None:
        """Put an event in; from any thread, never blocking."""
        self._events.append((*event, monotonic()))
        if event[0] != "message":
            self._urgent = True  # before the wake: `take` forgets one that comes while the owner computes
        if self._urgent or len(self._events) >= self._needed:
            with suppress(RuntimeError):  # awake already
                self._wake.release()

    def take(self, needed: int, timeout: float | None) -> list[Stamped]:
        """Take all events out.

        Parameters
        ----------
        needed : int
            Number of messages to wait for; any other event ends the wait.
        timeout : float or None
            Longest wait (s); None for no limit.

        Returns
        -------
        list[Stamped]
            The present events, in order; perhaps fewer than needed, or, rarely, none before the timeout.
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
        return taken
