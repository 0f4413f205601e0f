"""A line of finite rate with a finite queue before it."""

from __future__ import annotations

from typing import Annotated

import msgspec

from wire.plausible import Plausible, Unit


class Rate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    r"""First in, first out, what does not fit is dropped at the tail, reason "queue".

    A message of b bytes that comes at time t, when the line is busy until T, finds :math:`q = \max(0, (T - t) R)` bytes
    not yet sent. It goes if q is 0 or if q + b fits the queue, and is through at :math:`\max(t, T) + b / R`.
    """

    bytes_per_s: Annotated[
        float, Unit("bytes/s"), Plausible("a rate", 1.0, 1e11, hint="; it is in bytes, not bits, per second")
    ]
    """R (bytes per second). A line of 9.6 kbit/s has 1200."""
    queue_bytes: Annotated[int, Unit("bytes"), Plausible("a queue", 1, 1e9)] = 10_000
    """Most bytes that may wait, the message being sent included; an idle line takes any message."""

    def through(self, ready: float, busy_until: float, size: int) -> float | None:
        """When the message's last byte is sent (s, as the others), None if the queue is full.

        Examples
        --------
        >>> line = Rate(bytes_per_s=1000.0, queue_bytes=250)
        >>> line.through(0.0, 0.0, 100), line.through(0.0, 0.1, 100), line.through(0.0, 0.2, 100)
        (0.1, 0.2, None)
        """
        waiting = (busy_until - ready) * self.bytes_per_s
        if waiting <= 0.0:
            return ready + size / self.bytes_per_s
        # a millionth of a byte is what the times' last digits are worth
        if waiting + size > self.queue_bytes + 1e-6:
            return None
        return busy_until + size / self.bytes_per_s
