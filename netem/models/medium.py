"""Faults of a medium: links that are down, a line of finite rate with its queue, slots, copies, flipped bits."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Annotated

import msgspec

from gridpeers.netem.draws import Stream
from gridpeers.netem.models import INSTANT
from gridpeers.netem.models.delay import DELAY
from gridpeers.wire.schema.table_schema import Below, Plausible, Unit, probability

LONGEST_FLAP = 600.0  # Longest plausible up or down time (s)


class Cut(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Nothing passes while the entry holds; in a file `cut = true` means the same."""

    hold: bool = False
    """false: messages are lost, reason "cut"; true: they wait, and all arrive when the cut ends."""

    def down_until(self, t: float, from_s: float, to_s: float) -> float | None:
        """Return the time (s of run time) until which the link is down at t, None if it is up."""
        return to_s if from_s <= t < to_s else None


class Flap(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Up for up_s, down for down_s, and so on; the entry begins with up at from_s."""

    up_s: Annotated[float, Unit("s"), Plausible("the up time of a flap", 0.0, LONGEST_FLAP, above_zero=True)]
    """Time (s) for which the link is up."""
    down_s: Annotated[float, Unit("s"), Plausible("the down time of a flap", 0.0, LONGEST_FLAP, above_zero=True)]
    """Time (s) for which it is down."""
    hold: bool = False
    """false: messages are lost while it is down, reason "flap"; true: they wait, and arrive when it is up."""

    def down_until(self, t: float, from_s: float, to_s: float) -> float | None:
        if not from_s <= t < to_s:
            return None
        period = self.up_s + self.down_s
        number = math.floor((t - from_s) / period)
        end = from_s + (number + 1) * period
        if t < end - self.down_s:
            return None
        return min(end, to_s)


class Rate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    r"""A line of finite rate, first in, first out; a message that does not fit its queue is dropped, reason "queue".

    A message of b bytes that comes at time t, when the line is busy until T, finds :math:`q = \max(0, (T - t) R)` bytes
    not yet sent. It goes if q is 0 or if q + b fits the queue, and is through at :math:`\max(t, T) + b / R`.
    """

    bytes_per_s: Annotated[
        float, Unit("bytes/s"), Plausible("a rate", 1.0, 1e11, hint="; it is in bytes, not bits, per second")
    ]
    """R (bytes per second). A line of 9.6 kbit/s has 1200."""
    queue_bytes: Annotated[int, Unit("bytes"), Plausible("a queue", 1, 1e9)] = 10_000
    """Longest queue (bytes), with the message being sent; an idle line takes any message."""

    def through(self, ready: float, busy_until: float, size: int) -> float | None:
        """Return when the message's last byte is sent (s, as the others), None if the queue is full.

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


class Slots(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Slot n lasts from offset_s + n period_s for length_s; a message outside waits for the next one.

    Times are run time, so that links with different offsets share a medium. A slot has room for any number of messages;
    give a rate as well to limit it.
    """

    period_s: Annotated[float, Unit("s"), Plausible("the period of slots", 0.0, 10.0, above_zero=True)]
    """Time (s) from the start of a slot to the start of the next."""
    offset_s: Annotated[float, Unit("s"), Plausible("the offset of slots", 0.0, 10.0), Below("period_s")] = 0.0
    """Start of the first slot (s), below period_s."""
    length_s: Annotated[
        float,
        Unit("s"),
        Plausible("the length of a slot", 0.0, 10.0, above_zero=True),
        Below("period_s", or_equal=True),
    ]
    """Length of a slot (s), up to period_s."""

    def opens(self, ready: float) -> float:
        """Return when a message that is ready goes (s of run time).

        Examples
        --------
        >>> slots = Slots(period_s=1.0, offset_s=0.25, length_s=0.125)
        >>> slots.opens(0.0), slots.opens(0.3), slots.opens(0.375), slots.opens(1.25)
        (0.25, 0.3, 1.25, 1.25)
        """
        number = math.floor((ready - self.offset_s) / self.period_s + INSTANT / self.period_s)
        if ready < self.offset_s + number * self.period_s + self.length_s - INSTANT:
            return ready
        return max(self.offset_s + (number + 1) * self.period_s, ready)


_WHETHER, _WHICH, _PER_COPY = 0, 1, 2
"""Indices of the draws of the first copy of a corrupted message; those of the next follow."""


class Duplicate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A copy follows with probability p, a fixed time later; in a file `duplicate = 0.01` means at once."""

    p: Annotated[float, probability("of a duplicate")]
    """Probability that a delivered message has a copy."""
    extra_delay_s: Annotated[float, Unit("s"), DELAY] = 0.0
    """Added delay of the copy (s)."""

    def sampler(self, stream: Stream) -> Callable[[int], bool]:
        return partial(stream.chance, self.p)


class Corrupt(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One random bit of a copy flips with probability p; in a file `corrupt = 0.001` means the same."""

    p: Annotated[float, probability("of a corruption")]
    """Probability that an arriving copy of a message is corrupted."""
    checksum: bool = False
    """true: the link detects it by a checksum (CRC-32 finds every single bit) and drops the copy, reason "checksum".
    false: the receiver detects it by the message's own CRC-32 and rejects the copy, kind "corrupt"."""

    def sampler(self, stream: Stream) -> Callable[[int, int, int], int | None]:
        uniform, below, p = stream.uniform, stream.below, self.p

        def bit(seq: int, copy: int, size: int) -> int | None:
            index = copy * _PER_COPY
            if size == 0 or uniform(seq, index + _WHETHER) >= p:
                return None
            return below(8 * size, seq, index + _WHICH)

        return bit


def flip(payload: bytes, bit: int) -> bytes:
    """Return the payload with one bit flipped; bit 0 is the lowest of the first byte.

    Examples
    --------
    >>> flip(b"abc", 9)
    b'a`c'
    """
    byte, place = divmod(bit, 8)
    return payload[:byte] + bytes([payload[byte] ^ (1 << place)]) + payload[byte + 1 :]
