r"""What all losses have: a Markov chain in the message number, and a probability of loss in each of its states.

With transition matrix P (rows sum to 1), stationary law pi and loss probabilities l, message n is lost with probability
:math:`l_{S_n}`, and in the long run a share :math:`\sum_s \pi_s l_s` is. Bernoulli loss is the chain of one state.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import accumulate

import msgspec

from netem.draws import Stream
from netem.models.chain import Chain

Lost = Callable[[int], bool]
"""From a message number to whether that message is lost."""

_STATE, _LOSS = 0, 1
"""Index of the draw that moves the chain, and of the one that decides in a state where not all or none is lost."""


class LossModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model"):
    """What every loss has."""

    @property
    def transitions(self) -> tuple[tuple[float, ...], ...]:
        """P: probability of state j at message n + 1 (column) given state i at message n (row)."""
        raise NotImplementedError

    @property
    def stationary(self) -> tuple[float, ...]:
        """pi: share of messages that meet each state."""
        raise NotImplementedError

    @property
    def loss_in_state(self) -> tuple[float, ...]:
        """l: probability of loss in each state."""
        raise NotImplementedError

    @property
    def rate(self) -> float:
        """Share of messages that are lost in the long run."""
        return sum(pi * lost for pi, lost in zip(self.stationary, self.loss_in_state, strict=True))

    def sampler(self, stream: Stream) -> Lost:
        """How the losses of one link are drawn: one number moves the chain, another decides."""
        uniform, loss = stream.uniform, self.loss_in_state
        first = tuple(accumulate(self.stationary))
        rows = tuple(tuple(accumulate(row)) for row in self.transitions)
        chain = Chain(
            lambda seq: _chosen(first, uniform(seq, _STATE)),
            lambda state, seq: _chosen(rows[state], uniform(seq, _STATE)),
        )

        def lost(seq: int) -> bool:
            probability = loss[chain.at(seq)]
            return probability > 0.0 and (probability >= 1.0 or uniform(seq, _LOSS) < probability)

        return lost


def _chosen(cumulated: tuple[float, ...], u: float) -> int:
    """State whose share of (0, 1) holds u; the last one also takes what rounding leaves over."""
    for state, bound in enumerate(cumulated[:-1]):
        if u < bound:
            return state
    return len(cumulated) - 1
