"""Packets on their way through one direction of a relay: the queue before a rate, and the way of datagrams."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from netem.draws import Stream
from netem.relay.direction import Direction

NEVER = float("inf")


class Packet(NamedTuple):
    """A datagram, or what a segment of TCP carries."""

    number: int
    """Number in its direction of its connection, from 1, by which it finds its random numbers."""
    data: bytes


class Bottleneck:
    """A queue whose packets leave one after the other, at a rate. Time is an argument (s).

    The rate is in bytes per second; 0 is no limit.

    Examples
    --------
    >>> slow = Bottleneck(1000.0)
    >>> slow.put(Packet(1, b"x" * 500), 0.0)
    >>> slow.put(Packet(2, b"y" * 500), 0.1)
    >>> slow.take(0.4), slow.until
    ([], 0.5)
    >>> [left for _, left in slow.take(2.0)]
    [0.5, 1.0]
    """

    def __init__(self, rate: float = 0.0) -> None:
        self._rate = rate
        self._packets: deque[Packet] = deque()
        self.bytes = 0
        """Bytes in the queue."""
        self.until = NEVER
        """When the first of the queue will have left (s)."""

    def __len__(self) -> int:
        return len(self._packets)

    def put(self, packet: Packet, now: float) -> None:
        """Put a packet at the end of the queue."""
        self._packets.append(packet)
        self.bytes += len(packet.data)
        if len(self._packets) == 1:
            self.until = now + self._duration(packet)

    def take(self, now: float) -> list[tuple[Packet, float]]:
        """Return the packets that have left by now, each with the time (s) at which its last byte did."""
        left = []
        while self.until <= now:
            packet = self._packets.popleft()
            self.bytes -= len(packet.data)
            left.append((packet, self.until))
            self.until = self.until + self._duration(self._packets[0]) if self._packets else NEVER
        return left

    def set_rate(self, rate: float, now: float) -> None:
        """Change the rate; of the packet that is leaving, it counts for the rest."""
        if self._packets and rate != self._rate:
            left = max(0.0, self.until - now) * self._rate
            self.until = now + (left / rate if rate else 0.0)
        self._rate = rate

    def _duration(self, packet: Packet) -> float:
        return len(packet.data) / self._rate if self._rate else 0.0


class Datagrams:
    """Datagrams of one direction of a conversation: delayed, dropped and reordered. Time is an argument (s).

    Their random numbers come from `stream`, by purpose: the fate of datagram n depends on n alone.
    """

    def __init__(self, stream: Callable[[str], Stream], direction: Direction) -> None:
        self._direction = direction
        self._loss, self._delay, self._reorder = stream("loss"), stream("delay"), stream("reorder")
        self._flight: list[tuple[float, Packet]] = []
        self.bytes = 0

    def __len__(self) -> int:
        return len(self._flight)

    def send(self, packet: Packet, now: float) -> None:
        """Put a datagram on its way."""
        faults, number = self._direction.faults, packet.number
        if self._loss.uniform(number) < faults.loss:
            self._direction.counts.lost += 1
            return
        skips = self._reorder.uniform(number) < faults.reorder
        delay = 0.0 if skips else faults.delayed(self._delay.uniform(number))
        self.bytes += len(packet.data)
        heapq.heappush(self._flight, (now + delay, packet))

    def take(self, now: float) -> list[bytes]:
        """Return what arrives by now."""
        ready = []
        while self._flight and self._flight[0][0] <= now:
            ready.append(heapq.heappop(self._flight)[1].data)
            self.bytes -= len(ready[-1])
        return ready

    @property
    def until(self) -> float:
        """When the next datagram arrives (s)."""
        return self._flight[0][0] if self._flight else NEVER
