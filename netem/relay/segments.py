"""A model of TCP on a lossy link.

A relay in user space ends one TCP connection and begins another, so it never sees a segment, and a byte that it left
out would break the stream. So it treats the bytes as TCP would: a lost segment is sent again, and everything behind
waits for it (head-of-line blocking; TCP hands over bytes in order only). The rules, with R the round trip that the
relay is set to (delay there + delay back):

- every transmission of a segment is lost with probability `loss`, the repeated ones too, independently;
- **fast retransmit**: the first later segment that arrives tells of the loss; with its acknowledgement back, and R/4 of
  patience for mere reordering, the segment is sent again (RACK, RFC 8985, as Linux does; one is enough, not three);
- **time-out**: failing that, after RTO = R + max(0.2 s, 4 RTTVAR), doubled with every repetition (RFC 6298; 0.2 s and
  the sum are Linux's), RTTVAR being half of the jitter both ways, the mean deviation of a uniform delay.

Not in it: congestion windows (so no drop of the throughput with many bytes on the way), lost acknowledgements, the tail
loss probe, and the time-outs of opening a connection. A segment is the result of one read from the socket, at most
1448 bytes; at the rates of control every message is one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from netem.draws import Stream
from netem.relay.direction import Direction
from netem.relay.packets import NEVER, Packet

SIZE = 1448
"""Bytes of a full segment on Ethernet: 1500 less the headers of IPv4 and TCP with time stamps."""

RTO_MIN = 0.2
"""Linux's TCP_RTO_MIN (s)."""

RTO_MAX = 120.0
"""Linux's TCP_RTO_MAX (s)."""


class _Segment:
    """One segment on its way."""

    __slots__ = ("arrives", "packet", "resend", "sent", "transmissions")

    def __init__(self, packet: Packet) -> None:
        self.packet, self.transmissions = packet, 0
        self.sent = 0.0
        """When it was sent last (s)."""
        self.arrives = NEVER
        """When it arrives (s); never, if its last transmission was lost."""
        self.resend = NEVER
        """When it will be sent again (s), as far as is known."""


class Segments:
    """One direction of a TCP connection across a lossy link. Time is an argument (s) and never goes back.

    Their random numbers come from `stream`, by purpose; acknowledgements go in the direction `back`.
    """

    def __init__(self, stream: Callable[[str], Stream], direction: Direction, back: Direction) -> None:
        self._loss, self._delay = stream("loss"), stream("delay")
        self._direction, self._back = direction, back
        self._flight: deque[_Segment] = deque()
        self._lost: list[_Segment] = []
        self.bytes = 0

    def __len__(self) -> int:
        return len(self._flight)

    def send(self, packet: Packet, now: float) -> None:
        """Put a segment on its way."""
        self._send_again(now)
        self.bytes += len(packet.data)
        segment = _Segment(packet)
        self._flight.append(segment)
        self._transmit(segment, now)

    def take(self, now: float) -> list[bytes]:
        """Return what the receiver's TCP hands over by now: in order, up to the first segment that is missing."""
        self._send_again(now)
        ready = []
        while self._flight and self._flight[0].arrives <= now:
            ready.append(self._flight.popleft().packet.data)
            self.bytes -= len(ready[-1])
        return ready

    @property
    def until(self) -> float:
        """When the next segment arrives or is sent again (s)."""
        first = self._flight[0].arrives if self._flight else NEVER
        return min([first, *(segment.resend for segment in self._lost)])

    def _send_again(self, now: float) -> None:
        while self._lost:
            segment = min(self._lost, key=lambda one: one.resend)
            if segment.resend > now:
                return
            self._lost.remove(segment)
            self._transmit(segment, segment.resend)

    def _transmit(self, segment: _Segment, at: float) -> None:
        faults, back = self._direction.faults, self._back.faults
        segment.sent = at
        segment.transmissions += 1
        draw = segment.packet.number, segment.transmissions
        R = faults.delay + back.delay
        if self._loss.uniform(*draw) < faults.loss:
            rto = R + max(RTO_MIN, 4.0 * (faults.jitter + back.jitter) / 2.0)
            segment.arrives = NEVER
            segment.resend = at + min(rto * 2.0 ** (segment.transmissions - 1), RTO_MAX)
            self._lost.append(segment)
            self._direction.counts.lost += 1
            return
        segment.arrives = at + faults.delayed(self._delay.uniform(*draw))
        known = segment.arrives + back.delay + R / 4.0
        for lost in self._lost:
            if lost.sent < at:
                lost.resend = min(lost.resend, known)
