r"""Losses of single messages: a Markov chain in the message number, and a probability of loss in each of its states.

With transition matrix P (rows sum to 1), stationary law pi and loss probabilities l, message n is lost with probability
:math:`l_{S_n}`, and in the long run a share :math:`\sum_s \pi_s l_s` is. Bernoulli loss is the chain of one state.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import accumulate
from typing import Annotated

import msgspec

from gridpeers.netem.draws import Chain, Stream
from gridpeers.wire.plain_sum import plain_sum
from gridpeers.wire.schema.table_schema import Below, Problem, probability

Lost = Callable[[int], bool]

_STATE, _LOSS = 0, 1
"""Index of the draw that moves the chain, and of the one that decides in a state where not all or none is lost."""


class LossModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model"):
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
        """Return the losses of one link by message number: one draw moves the chain, another decides."""
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
    """Return the state whose share of (0, 1) contains u; the last one takes the rest that rounding leaves."""
    for state, bound in enumerate(cumulated[:-1]):
        if u < bound:
            return state
    return len(cumulated) - 1


class Bernoulli(LossModel, frozen=True, kw_only=True, tag="bernoulli"):
    """Loss with probability p; in a file `loss = 0.02` means the same."""

    p: Annotated[float, probability("of a loss")]
    """Probability of loss."""

    @property
    def transitions(self) -> tuple[tuple[float, ...], ...]:
        return ((1.0,),)

    @property
    def stationary(self) -> tuple[float, ...]:
        return (1.0,)

    @property
    def loss_in_state(self) -> tuple[float, ...]:
        return (self.p,)

    def sampler(self, stream: Stream) -> Lost:
        return partial(stream.chance, self.p)


class GilbertElliott(LossModel, frozen=True, kw_only=True, tag="gilbert-elliott"):
    r"""Two states; with loss_good = 0 and loss_bad = 1 (Gilbert's simple case) bursts are geometric, mean 1/r.

    .. math:: \pi_\mathrm{bad} = \frac{p}{p + r}, \qquad
              \mathrm{loss} = \pi_\mathrm{bad} l_\mathrm{bad} + (1 - \pi_\mathrm{bad}) l_\mathrm{good}

    The moves are from message to message, not in time: a link that sends twice as often has bursts half as long.

    References
    ----------
    Gilbert, Bell System Technical Journal 39 (1960) 1253-1265. https://doi.org/10.1002/j.1538-7305.1960.tb03959.x
    Elliott, Bell System Technical Journal 42 (1963) 1977-1997. https://doi.org/10.1002/j.1538-7305.1963.tb00955.x
    """

    p: Annotated[float, probability("p (good to bad)")]
    """Probability of going from good to bad, from one message to the next."""
    r: Annotated[float, probability("r (bad to good)", above_zero=True)]
    """Probability of going from bad to good; a bad time lasts 1/r messages on average."""
    loss_good: Annotated[float, probability("loss_good"), Below("loss_bad", or_equal=True)] = 0.0
    """Probability of loss in the good state (`tc netem`: 1 - k)."""
    loss_bad: Annotated[float, probability("loss_bad")] = 1.0
    """Probability of loss in the bad state (`tc netem`: 1 - h)."""

    @property
    def transitions(self) -> tuple[tuple[float, ...], ...]:
        return ((1.0 - self.p, self.p), (self.r, 1.0 - self.r))

    @property
    def stationary(self) -> tuple[float, ...]:
        bad = self.p / (self.p + self.r)
        return (1.0 - bad, bad)

    @property
    def loss_in_state(self) -> tuple[float, ...]:
        return (self.loss_good, self.loss_bad)


class Markov(LossModel, frozen=True, kw_only=True, tag="markov"):
    r"""The four states of `tc netem loss state` (Salsano et al.).

    State 1: received, between bursts. 2: received, within a burst. 3: lost, within a burst. 4: a single loss between
    bursts, after which 1 follows. From state 1 one goes to 3 (p13) or 4 (p14), from 3 to 1 (p31) or 2 (p32), from 2 to
    3 (p23); else one stays.

    .. math:: \pi_3 = \pi_1 \frac{p_{13}}{p_{31}}, \quad \pi_2 = \pi_3 \frac{p_{32}}{p_{23}}, \quad
              \pi_4 = \pi_1 p_{14}, \quad \mathrm{loss} = \pi_3 + \pi_4

    References
    ----------
    Salsano, Ludovici, Ordine, Giannuzzi, "Definition of a general and intuitive loss model for packet networks and its
    implementation in the Netem module in the Linux kernel", University of Rome Tor Vergata, v3.1, 2012.
    """

    p13: Annotated[float, probability("p13")]
    """Probability that a burst begins."""
    p31: Annotated[float, probability("p31", above_zero=True)]
    """Probability that a burst ends."""
    p32: Annotated[float, probability("p32")] = 0.0
    """Probability that, within a burst, messages come through for a while."""
    p23: Annotated[float, probability("p23", above_zero=True)] = 1.0
    """Probability that the burst then goes on."""
    p14: Annotated[float, probability("p14")] = 0.0
    """Probability of a single loss between bursts."""

    @property
    def transitions(self) -> tuple[tuple[float, ...], ...]:
        return (
            (1.0 - self.p13 - self.p14, 0.0, self.p13, self.p14),
            (0.0, 1.0 - self.p23, self.p23, 0.0),
            (self.p31, self.p32, 1.0 - self.p31 - self.p32, 0.0),
            (1.0, 0.0, 0.0, 0.0),
        )

    @property
    def stationary(self) -> tuple[float, ...]:
        burst = self.p13 / self.p31
        weights = (1.0, burst * self.p32 / self.p23, burst, self.p14)
        return tuple(weight / plain_sum(weights) for weight in weights)

    @property
    def loss_in_state(self) -> tuple[float, ...]:
        return (0.0, 0.0, 1.0, 1.0)

    def relations(self) -> list[Problem]:
        problems = []
        for first, second in (("p13", "p14"), ("p31", "p32")):
            both = getattr(self, first) + getattr(self, second)
            if both > 1.0:
                text = f"{first} and {second} leave the same state, so their sum is at most 1, got {both:g}"
                problems.append(Problem(first, text))
        return problems


AnyLoss = Bernoulli | GilbertElliott | Markov  # Every loss a scenario may name
