"""What TCP makes of a lossy link, as a model.

A relay in user space ends one TCP connection and begins another, so it never sees a segment, and a byte that it left
out would break the stream. So it does to the bytes what TCP would: what is lost is sent again, and everything behind
waits for it (head-of-line blocking; TCP hands over bytes in order only). The rules, with R the round trip that the
relay is set to (delay there + delay back):

- every transmission of a segment is lost with probability `loss`, the repeated ones too, independently;
- **fast retransmit**: the first later segment that arrives tells of the loss; with its acknowledgement back, and R/4 of
  patience for mere reordering, the segment is sent again (RACK, RFC 8985, as Linux does; one is enough, not three);
- **time-out**: failing that, after RTO = R + max(0.2 s, 4 RTTVAR), doubled with every repetition (RFC 6298; 0.2 s and
  the sum are Linux's), RTTVAR being half of the jitter both ways, the mean deviation of a uniform delay.

Not in it: congestion windows (so no drop of the throughput with many bytes on the way), lost acknowledgements, the tail
loss probe, and the time-outs of opening a connection. A segment is what one read from the socket gave, at most 1448
bytes; at the rates of control every message is one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from netem.draws import Stream
from netem.relay.bottleneck import NEVER
from netem.relay.faults import Faults

SIZE = 1448
"""Bytes of a full segment on Ethernet: 1500 less the headers of IPv4 and TCP with time stamps."""

RTO_MIN = 0.2
"""Linux's TCP_RTO_MIN (s)."""

RTO_MAX = 120.0
"""Linux's TCP_RTO_MAX (s)."""


class _Segment:
    """One segment on its way."""

    __slots__ = ("arrives", "data", "number", "resend", "sent", "turn")

    def __init__(self, data: bytes, number: int) -> None:
        self.data, self.number, self.turn = data, number, 0
        self.sent = 0.0
        self.arrives = NEVER
        """When it arrives (s); never, if its last transmission was lost."""
        self.resend = NEVER
        """When it will be sent again (s), as far as is known."""


class Segments:
    """One direction of a TCP connection across a lossy link. Time is an argument (s) and never goes back.

    Parameters
    ----------
    stream : Callable[[str], Stream]
        The random numbers of this connection and direction, for a purpose.
    ways : Callable[[], tuple[Faults, Faults]]
        What is set now: for this direction, and for the one in which acknowledgements go.
    on_loss : Callable[[], None], optional
        Called at each lost transmission.
    """

    def __init__(
        self,
        stream: Callable[[str], Stream],
        ways: Callable[[], tuple[Faults, Faults]],
        on_loss: Callable[[], None] = lambda: None,
    ) -> None:
        self._loss, self._delay = stream("loss"), stream("delay")
        self._ways, self._on_loss = ways, on_loss
        self._flight: deque[_Segment] = deque()
        self._lost: list[_Segment] = []
        self._sent = 0
        self.bytes = 0
        """How many are on the way."""

    def __len__(self) -> int:
        return len(self._flight)

    def send(self, data: bytes, now: float) -> None:
        """Put a segment on its way."""
        self._send_again(now)
        self._sent += 1
        self.bytes += len(data)
        segment = _Segment(data, self._sent)
        self._flight.append(segment)
        self._transmit(segment, now)

    def take(self, now: float) -> list[bytes]:
        """What the receiver's TCP hands over by now: in order, up to the first segment that is missing."""
        self._send_again(now)
        ready = []
        while self._flight and self._flight[0].arrives <= now:
            segment = self._flight.popleft()
            self.bytes -= len(segment.data)
            ready.append(segment.data)
        return ready

    @property
    def until(self) -> float:
        """When something is to be done next (s)."""
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
        faults, back = self._ways()
        segment.sent = at
        segment.turn += 1
        R = faults.delay + back.delay
        if self._loss.uniform(segment.number, segment.turn) < faults.loss:
            rto = R + max(RTO_MIN, 4.0 * (faults.jitter + back.jitter) / 2.0)
            segment.arrives = NEVER
            segment.resend = at + min(rto * 2.0 ** (segment.turn - 1), RTO_MAX)
            self._lost.append(segment)
            self._on_loss()
            return
        segment.arrives = at + faults.delayed(self._delay.uniform(segment.number, segment.turn))
        known = segment.arrives + back.delay + R / 4.0
        for lost in self._lost:
            if lost.sent < at:
                lost.resend = min(lost.resend, known)
