"""Messages that arrive twice, or with a flipped bit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import msgspec

from netem.draws import Stream
from netem.models.delay import DELAY
from wire.schema.plausible import Probability, Unit

_WHETHER, _WHICH, _PER_COPY = 0, 1, 2
"""Indices of the draws of the first copy of a corrupted message; those of the next follow."""


class Duplicate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """With probability p a copy follows, a fixed time later; in a file `duplicate = 0.01` says: at once."""

    p: Annotated[float, Probability("a duplicate")]
    """Probability that a delivered message has a copy."""
    extra_delay_s: Annotated[float, Unit("s"), DELAY] = 0.0
    """How much later the copy arrives (s)."""

    def sampler(self, stream: Stream) -> Callable[[int], bool]:
        """Return, by message number, whether there is a copy."""
        uniform, p = stream.uniform, self.p
        return lambda seq: uniform(seq) < p


class Corrupt(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """With probability p a bit of a copy is flipped, each bit alike; in a file `corrupt = 0.001` says the same."""

    p: Annotated[float, Probability("a corruption")]
    """Probability that an arriving copy of a message is corrupted."""
    checksum: bool = False
    """True: the link notices it by its checksum (CRC-32 finds every single bit) and drops the copy, reason "checksum".
    False: the copy is handed on, and the receiver finds it by the message's own CRC-32: a reject, of kind "corrupt"."""

    def sampler(self, stream: Stream) -> Callable[[int, int, int], int | None]:
        """Return the bit that is flipped by message number, copy and size (bytes), None if none is."""
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
