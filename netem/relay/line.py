"""One direction of a connection or conversation: a bottleneck, then a way with delay and loss. Pure."""

from __future__ import annotations

from netem.relay.direction import Direction
from netem.relay.packets import Bottleneck, Datagrams, Packet
from netem.relay.segments import Segments

WINDOW = 4 << 20
"""Bytes of a TCP connection that may be on the way: what Linux gives one at most (tcp_wmem)."""


class ImpairedLine:
    """One direction of a connection or conversation. Time is an argument (s) and never goes back."""

    def __init__(self, direction: Direction, way: Datagrams | Segments) -> None:
        self.direction, self._way = direction, way
        self._queue = Bottleneck(direction.faults.rate)
        self._number = 0

    def __len__(self) -> int:
        return len(self._queue) + len(self._way)

    @property
    def has_room(self) -> bool:
        """Whether more data may come, from a sender that waits for it."""
        return self._queue.bytes < self.direction.faults.queue and self._way.bytes < WINDOW

    def send(self, data: bytes, now: float) -> None:
        """Put data on their way; a datagram is lost if the queue is full."""
        faults, counts = self.direction.faults, self.direction.counts
        counts.came += 1
        self._number += 1
        full = self._queue and self._queue.bytes + len(data) > faults.queue
        if full and isinstance(self._way, Datagrams):
            counts.full += 1
            return
        self._queue.set_rate(faults.rate, now)
        self._queue.put(Packet(self._number, data), now)

    def take(self, now: float) -> list[bytes]:
        """Return what arrives by now."""
        self._queue.set_rate(self.direction.faults.rate, now)
        for packet, left in self._queue.take(now):
            self._way.send(packet, left)
        return self._way.take(now)

    @property
    def until(self) -> float:
        """When to call `take` next (s)."""
        return min(self._queue.until, self._way.until)
