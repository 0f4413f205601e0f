"""Loss in bursts with gaps inside them, and single losses between them: four states."""

from __future__ import annotations

from typing import Annotated

from netem.models.loss.loss_model import LossModel
from wire.plausible import Probability
from wire.table_schema import Problem


class Markov(LossModel, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="markov"):
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

    p13: Annotated[float, Probability("p13")]
    """Probability that a burst begins."""
    p31: Annotated[float, Probability("p31", above_zero=True)]
    """Probability that a burst ends."""
    p32: Annotated[float, Probability("p32")] = 0.0
    """Probability that, within a burst, messages come through for a while."""
    p23: Annotated[float, Probability("p23", above_zero=True)] = 1.0
    """Probability that the burst then goes on."""
    p14: Annotated[float, Probability("p14")] = 0.0
    """Probability of a single loss between bursts."""

    @property
    def transitions(self) -> tuple[tuple[float, ...], ...]:
        """States 1 to 4."""
        return (
            (1.0 - self.p13 - self.p14, 0.0, self.p13, self.p14),
            (0.0, 1.0 - self.p23, self.p23, 0.0),
            (self.p31, self.p32, 1.0 - self.p31 - self.p32, 0.0),
            (1.0, 0.0, 0.0, 0.0),
        )

    @property
    def stationary(self) -> tuple[float, ...]:
        """States 1 to 4."""
        burst = self.p13 / self.p31
        weights = (1.0, burst * self.p32 / self.p23, burst, self.p14)
        return tuple(weight / sum(weights) for weight in weights)

    @property
    def loss_in_state(self) -> tuple[float, ...]:
        """States 1 to 4."""
        return (0.0, 0.0, 1.0, 1.0)

    def relations(self) -> list[Problem]:
        """Return what its values ask of each other."""
        found = []
        for first, second in (("p13", "p14"), ("p31", "p32")):
            both = getattr(self, first) + getattr(self, second)
            if both > 1.0:
                text = f"{first} and {second} leave the same state, so their sum is at most 1, got {both:g}"
                found.append(Problem(first, text))
        return found
