"""Some messages arrive twice."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

import msgspec

from netem.draws import Stream
from netem.models.delay.delay_model import DELAY
from wire.plausible import Probability, Unit


class Duplicate(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """With probability p a copy follows, a fixed time later; in a file `duplicate = 0.01` says: at once."""

    p: Annotated[float, Probability("a duplicate")]
    """Probability that a delivered message has a copy."""
    extra_delay_s: Annotated[float, Unit("s"), DELAY] = 0.0
    """How much later the copy arrives (s)."""

    def sampler(self, stream: Stream) -> Callable[[int], bool]:
        """From a message number to whether there is a copy."""
        uniform, p = stream.uniform, self.p
        return lambda seq: uniform(seq) < p
