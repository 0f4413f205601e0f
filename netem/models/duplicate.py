"""Some messages arrive twice."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from netem.draws import Stream
from netem.netem_errors import Mistake, probability, seconds


class Duplicate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """With probability p a copy follows, a fixed time later; in a file `duplicate = 0.01` says: at once."""

    p: float
    """Probability that a delivered message has a copy."""
    extra_delay_s: float = 0.0
    """How much later the copy arrives (s)."""

    def sampler(self, stream: Stream) -> Callable[[int], bool]:
        """From a message number to whether there is a copy."""
        uniform, p = stream.uniform, self.p
        return lambda seq: uniform(seq) < p

    def mistakes(self) -> list[Mistake]:
        """Values that cannot be meant."""
        return probability("p", self.p, "a duplicate") + seconds("extra_delay_s", self.extra_delay_s, "a delay")
