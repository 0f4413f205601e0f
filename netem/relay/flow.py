"""The timer of one direction of a connection, and the link that all connections of a relay share."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

from netem.relay.direction import Direction
from netem.relay.line import ImpairedLine
from netem.relay.packets import NEVER


@dataclass
class RelayedLink:
    """Both directions of a relay, and whether anything passes at all."""

    there: Direction
    back: Direction
    seed: int
    stalled_until: float = -NEVER
    """When the stall is over (s on the loop's clock)."""
    is_cut: bool = False
    connections: int = 0
    """Number of connections so far; each has its number, from 1."""
    listeners: set[Callable[[], None]] = field(default_factory=set)
    """Called after a change."""

    def new_connection(self) -> str:
        """Return the number of a new connection, which names its random numbers."""
        self.connections += 1
        return str(self.connections)

    def changed(self) -> None:
        """Apply a change to all flows."""
        for listener in list(self.listeners):
            listener()


class Flow:
    """Takes data into a line of a link, and forwards them when they arrive; calls `after_look` whenever it looked."""

    def __init__(
        self,
        link: RelayedLink,
        line: ImpairedLine,
        forward: Callable[[list[bytes]], None],
        after_look: Callable[[], None] = lambda: None,
    ) -> None:
        self.line, self._link, self._forward, self._after_look = line, link, forward, after_look
        self._counts = line.direction.counts
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self.is_closed = False
        self.is_blocked = False
        """Whether the receiver takes nothing for now."""
        self.last = self._loop.time()
        """When the last data came (s)."""
        link.listeners.add(self.look)

    def put(self, data: bytes) -> None:
        """Take data in."""
        self.last = self._loop.time()
        if not self.is_closed:
            self.line.send(data, self.last)
            self.look()

    def unblock(self) -> None:
        """Let the receiver take data again."""
        self.is_blocked = False
        self.look()

    def look(self) -> None:
        """Forward what has arrived, and plan the next look."""
        if self.is_closed:
            return
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        link, now = self._link, self._loop.time()
        if link.stalled_until <= now and not self.is_blocked and (arrived := self.line.take(now)):
            if link.is_cut:
                self._counts.cut += len(arrived)
            else:
                self._counts.forwarded += len(arrived)
                self._forward(arrived)
        until = max(link.stalled_until, self.line.until)
        if until < NEVER and not self.is_blocked and not self.is_closed:
            self._timer = self._loop.call_at(until, self.look)
        self._after_look()

    def close(self) -> None:
        """End; data on the way are lost."""
        if self.is_closed:
            return
        self.is_closed = True
        self._link.listeners.remove(self.look)
        self._counts.cut += len(self.line)
        if self._timer is not None:
            self._timer.cancel()
