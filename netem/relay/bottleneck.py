"""The slow place of a link: packets wait in a queue and leave one after the other, at a rate."""

from __future__ import annotations

from collections import deque

NEVER = float("inf")


class Bottleneck:
    """A queue with a rate. Time is an argument (s).

    Parameters
    ----------
    rate : float, optional
        Bytes per second; 0 for no limit.

    Examples
    --------
    >>> slow = Bottleneck(1000.0)
    >>> slow.put(b"x" * 500, 0.0)
    >>> slow.put(b"y" * 500, 0.1)
    >>> slow.take(0.4), slow.until
    ([], 0.5)
    >>> [left for _, left in slow.take(2.0)]
    [0.5, 1.0]
    """

    def __init__(self, rate: float = 0.0) -> None:
        self._rate = rate
        self._waiting: deque[bytes] = deque()
        self.bytes = 0
        """How many wait."""
        self.until = NEVER
        """When the first of the queue will have left (s)."""

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, packet: bytes, now: float) -> None:
        """Put a packet at the end of the queue."""
        self._waiting.append(packet)
        self.bytes += len(packet)
        if len(self._waiting) == 1:
            self.until = now + self._time(packet)

    def take(self, now: float) -> list[tuple[bytes, float]]:
        """What has left by now, each with the time (s) at which its last byte did."""
        left = []
        while self.until <= now:
            packet = self._waiting.popleft()
            self.bytes -= len(packet)
            left.append((packet, self.until))
            self.until = self.until + self._time(self._waiting[0]) if self._waiting else NEVER
        return left

    def set_rate(self, rate: float, now: float) -> None:
        """Change the rate; of the packet that is leaving, it counts for the rest."""
        if self._waiting and rate != self._rate:
            left = max(0.0, self.until - now) * self._rate
            self.until = now + (left / rate if rate else 0.0)
        self._rate = rate

    def _time(self, packet: bytes) -> float:
        return len(packet) / self._rate if self._rate else 0.0
