"""The queue of events for the one thread that owns the core."""

from __future__ import annotations

import threading
from _thread import allocate_lock
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from math import inf
from time import monotonic

from gridpeers.wire.backlog import ROOM, SMALL, Backlog, Kind, Loss, Stamped, TokenEvent, TokenQueue
from gridpeers.wire.bounds import LONGEST_MESSAGE

Event = tuple[Kind, str, bytes]
"""Kind, key and payload."""

HELD = 1.0
"""Longest time (s) for which a known sender's message waits for room where none may be lost. Its sender waits
meanwhile, and Zenoh closes a link only after 5 s. Then it comes in without room: a lost one would end the run, and a
sender that waits so long for each cannot bring many."""


class Inbox:
    """Queue events from Zenoh's threads to the owner's, within the bounds of `gridpeers.wire.backlog` and of tokens.

    The owner states how many messages it needs to continue, and wakes only then: in a full mesh of nine
    this is one wake a tick instead of nine, and half of the time of a tick. Any other event wakes it at once.

    Parameters
    ----------
    holds : bool, optional
        Whether a known sender's message waits for room, as in simulated time, where none may be lost: then the sender
        goes no faster than the owner.

    Attributes
    ----------
    is_known : Callable[[str, bytes], bool]
        Whether a message on a key is of a known sender; called from Zenoh's threads, and only when many wait.
    is_noted : Callable[[str], bool]
        Whether the owner has noted the holder of a token, so that it must learn of its end
        (`gridpeers.wire.backlog`); called from Zenoh's threads. By default it has noted everybody, and no token is
        lost.
    """

    def __init__(self, *, holds: bool = False) -> None:
        self.is_known: Callable[[str, bytes], bool] = lambda key, payload: False
        self.is_noted: Callable[[str], bool] = lambda key: True
        self._holds = holds
        self._events: deque[Stamped] = deque()
        self._needed = 1
        self._urgent = False
        self._wake = allocate_lock()
        self._wake.acquire()
        self._backlog, self._tokens, self._guard = Backlog(), TokenQueue(), allocate_lock()
        """The guard is held while backlog or tokens are read or changed, and while what they admit is put in."""
        self._counted = False
        """Whether the backlog has counted any of the messages that wait, or one waits for room."""
        self._emptied = threading.Condition(self._guard)

    def put(self, event: Event, *, asked: bool = False) -> None:
        """Put an event in, from any thread; drop and count a message or token for which there is no room.

        An answer to an own question (`asked`) has room as a known sender's message has.
        """
        if event[0] == "appeared" or event[0] == "vanished":
            self._put_token(event[0], event[1])
        elif event[0] != "message":
            self._events.append((*event, monotonic()))
            self._urgent = True  # before the wake: `take` forgets one that comes while the owner computes
        elif len(self._events) < ROOM and len(event[2]) <= SMALL and not self._tokens.waiting:
            self._events.append((*event, monotonic()))
        else:
            self._put_if_admitted(event, asked=asked)
        if self._urgent or len(self._events) >= self._needed:
            with suppress(RuntimeError):  # awake already
                self._wake.release()

    def _put_token(self, kind: TokenEvent, key: str) -> None:
        """Put a token in, or let it wait; the owner is woken for the first that waits too, as its time is near."""
        at = monotonic()
        with self._guard:
            waited = self._tokens.waiting
            comes = self._tokens.put(kind, key, at, self.is_noted)
            if comes:
                self._events.append((kind, key, b"", at))
            if comes or (not waited and self._tokens.waiting):
                self._urgent = True

    def _put_if_admitted(self, event: Event, *, asked: bool) -> None:
        """Put a message in that is one of many, long, or behind tokens, if it may wait.

        One whose sender is not known stays behind the tokens: rejected before its sender's token, it would be lost.
        """
        _, key, payload = event
        size, known = len(payload), asked or self.is_known(key, payload)
        if size > LONGEST_MESSAGE and not asked:
            self._refuse(key, size)
            return
        with self._guard:
            if known and self._holds:
                self._wait_for_room(key, size)
                self._backlog.add(key, size, waiting=len(self._events))
            elif not self._backlog.admits(key, size, known=known, waiting=len(self._events) + self._tokens.messages):
                return
            self._counted = True  # before it is put in: `take` looks for it afterwards
            if self._tokens.waiting and not known:
                self._tokens.put_behind((*event, monotonic()))
            else:
                self._events.append((*event, monotonic()))

    def _wait_for_room(self, key: str, size: int) -> None:
        """Wait until there is room, at most `HELD`; the guard is held, but for the wait."""
        end = monotonic() + HELD
        while not self._backlog.has_room(key, size, known=True, waiting=len(self._events)):
            self._counted = self._urgent = True  # the owner may wait for more than there is room for
            with suppress(RuntimeError):
                self._wake.release()
            left = end - monotonic()
            if left <= 0.0:
                return
            self._emptied.wait(left)

    def _refuse(self, key: str, size: int) -> None:
        with self._guard:
            self._backlog.lose(key, "oversized", f"{size} bytes, at most {LONGEST_MESSAGE} are allowed")

    def take_losses(self) -> tuple[Loss, ...]:
        """Take out the messages and tokens that were dropped since the last call."""
        if not (self._backlog.has_losses or self._tokens.has_loss):
            return ()
        with self._guard:
            return self._backlog.take_losses() + self._tokens.take_loss()

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
            self._wake.acquire(timeout=self._longest(timeout))
        self._urgent = False
        taken = []
        while events:
            taken.append(events.popleft())
        if self._counted or not self._tokens.is_idle:
            with self._guard:
                while events:  # none that is counted waits any more, and no token that comes in now
                    taken.append(events.popleft())
                self._counted = False
                taken += self._tokens.taken(monotonic())
                self._backlog.emptied(self._tokens.message_bytes)
                self._emptied.notify_all()
        return taken

    def _longest(self, timeout: float | None) -> float:
        """Return how long to wait (s), until a token that waits may come in at the latest; -1 for no limit."""
        due = self._tokens.due
        if due == inf:
            return -1.0 if timeout is None else timeout
        return max(0.0, min(due - monotonic(), inf if timeout is None else timeout))
