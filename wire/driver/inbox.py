"""What has come in and waits for the one thread that owns the core."""

from __future__ import annotations

from _thread import allocate_lock
from collections import deque
from contextlib import suppress
from time import monotonic
from typing import Literal

Kind = Literal["message", "appeared", "vanished", "word"]
"""A message or answer; a token that came or went; or a word from another thread of the own process."""

Event = tuple[Kind, str, bytes]
"""Kind, key and payload."""

Stamped = tuple[Kind, str, bytes, float]
"""The same, and when it came (s, monotonic): it may have waited here for its owner."""


class Inbox:
    """Events from Zenoh's threads to the owner's.

    The owner says how many messages it needs before it can do anything, and is woken only then: in a full mesh of nine
    that is one wake a tick instead of nine, half of the time of a tick. Whatever is not a message wakes it at once.

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
        self._wanted = 1
        self._urgent = False
        self._wake = allocate_lock()
        self._wake.acquire()

    def put(self, event: Event) -> None:
        """Put an event in; from any thread, never blocking."""
        self._events.append((*event, monotonic()))
        if event[0] != "message":
            self._urgent = True  # before the wake: one that comes while the owner computes is forgotten by `take`
        if self._urgent or len(self._events) >= self._wanted:
            with suppress(RuntimeError):  # awake already
                self._wake.release()

    def take(self, wanted: int, timeout: float | None) -> list[Stamped]:
        """Take all events out.

        Parameters
        ----------
        wanted : int
            How many messages to wait for, unless something else comes.
        timeout : float or None
            Longest wait (s); None for no end.

        Returns
        -------
        list[Stamped]
            What is there, in order; perhaps fewer than wanted, or, now and then, nothing before the time is out.
        """
        events = self._events
        self._wake.acquire(blocking=False)  # an old wake is of no interest
        self._wanted = wanted
        if len(events) < wanted and not self._urgent:
            self._wake.acquire(timeout=-1.0 if timeout is None else timeout)
        self._urgent = False
        taken = []
        while events:
            taken.append(events.popleft())
        return taken
