"""Every message is lost with the same probability, whatever became of the others."""

from __future__ import annotations

from typing import Annotated

from netem.draws import Stream
from netem.models.loss.loss_model import LossModel, Lost
from wire.plausible import Probability


class Bernoulli(LossModel, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="bernoulli"):
    """Loss with probability p; in a file `loss = 0.02` says the same."""

    p: Annotated[float, Probability("a loss")]
    """Probability of loss."""

    @property
    def transitions(self) -> tuple[tuple[float, ...], ...]:
        """The one state stays."""
        return ((1.0,),)

    @property
    def stationary(self) -> tuple[float, ...]:
        """There is one state."""
        return (1.0,)

    @property
    def loss_in_state(self) -> tuple[float, ...]:
        """Its probability of loss."""
        return (self.p,)

    def sampler(self, stream: Stream) -> Lost:
        """Draw one number a message, without a chain."""
        uniform, p = stream.uniform, self.p
        return lambda seq: uniform(seq) < p
