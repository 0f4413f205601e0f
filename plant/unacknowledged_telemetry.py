"""What the recorders of a run in simulated time have not acknowledged: kept, and published again on request. Pure.

A recorder says by a `Command` "telemetry" which Telemetry it needs next, after each that it has taken and every second.
The same number twice means that something is lost, as when its link broke while it stood still.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import takewhile

WINDOW = 1_000_000
"""Bytes without acknowledgement beyond which the plant goes on with no further tick. A loopback link takes as many
without its reader, so Zenoh has no reason to close it."""


class UnacknowledgedTelemetry:
    """Messages for the recorders that a run waits for; without any, nothing is kept.

    Each message has the number of the next or same Telemetry: messages between two of them count to the later one.

    Parameters
    ----------
    recorders : Iterable[str]
        Names of the recorders.

    Examples
    --------
    >>> kept = UnacknowledgedTelemetry(["history"])
    >>> for number, payload in [(0, b"T0"), (1, b"L1"), (1, b"T1")]:
    ...     kept.keep(number, payload)
    >>> kept.acknowledged("history", 1), kept.acknowledged("history", 1)
    (None, [b'L1', b'T1'])
    >>> kept.acknowledged("history", 2), kept.is_empty
    (None, True)
    """

    def __init__(self, recorders: Iterable[str]) -> None:
        self._needed = dict.fromkeys(recorders, 0)
        """Number of the Telemetry that each recorder needs next."""
        self._kept: deque[tuple[int, bytes]] = deque()
        self._bytes = 0

    def keep(self, number: int, payload: bytes) -> None:
        """Keep a message that counts to the Telemetry of this number."""
        if self._needed:
            self._kept.append((number, payload))
            self._bytes += len(payload)

    def acknowledged(self, recorder: str, number: int) -> list[bytes] | None:
        """Take a recorder's word that it has all before a number; return what to publish again if it is no news.

        None if it is news: then nothing is to be published again.
        """
        again = number <= self._needed[recorder]
        self._needed[recorder] = max(number, self._needed[recorder])
        while self._kept and self._kept[0][0] < min(self._needed.values()):
            self._bytes -= len(self._kept.popleft()[1])
        return [payload for its, payload in self._kept if its >= number] if again else None

    def others(self, number: int) -> int:
        """Return the number of messages that count to a Telemetry that is yet to be kept."""
        return sum(1 for _ in takewhile(lambda kept: kept[0] == number, reversed(self._kept)))

    @property
    def is_full(self) -> bool:
        """Whether the plant is to wait."""
        return self._bytes > WINDOW

    @property
    def is_empty(self) -> bool:
        """Whether the recorders have everything."""
        return not self._kept
