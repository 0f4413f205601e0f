"""The same delay for every message."""

from __future__ import annotations

from typing import Annotated

from netem.draws import Stream
from netem.models.delay.delay_model import DELAY, DelayModel, Sampler
from wire.plausible import Unit


class Constant(DelayModel, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="constant"):
    """Delay d for every message; in a file `delay = 0.1` says the same."""

    delay_s: Annotated[float, Unit("s"), DELAY]
    """d (s)."""

    def sampler(self, stream: Stream) -> Sampler:
        """Draw nothing."""
        delay_s = self.delay_s
        return lambda seq: delay_s
