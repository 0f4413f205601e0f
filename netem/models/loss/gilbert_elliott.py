"""Loss in bursts: a good and a bad state, each with its own loss."""

from __future__ import annotations

from typing import Annotated

from netem.models.loss.loss_model import LossModel
from wire.plausible import Probability
from wire.table_schema import Problem


class GilbertElliott(
    LossModel, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="gilbert-elliott"
):
    r"""Two states; with loss_good = 0 and loss_bad = 1 (Gilbert's simple case) bursts are geometric, mean 1/r.

    .. math:: \pi_\mathrm{bad} = \frac{p}{p + r}, \qquad
              \mathrm{loss} = \pi_\mathrm{bad} l_\mathrm{bad} + (1 - \pi_\mathrm{bad}) l_\mathrm{good}

    The moves are from message to message, not in time: a link that sends twice as often has bursts half as long.

    References
    ----------
    Gilbert, Bell System Technical Journal 39 (1960) 1253-1265. https://doi.org/10.1002/j.1538-7305.1960.tb03959.x
    Elliott, Bell System Technical Journal 42 (1963) 1977-1997. https://doi.org/10.1002/j.1538-7305.1963.tb00955.x
    """

    p: Annotated[float, Probability("p (good to bad)")]
    """Probability of going from good to bad, from one message to the next."""
    r: Annotated[float, Probability("r (bad to good)", above_zero=True)]
    """Probability of going from bad to good; a bad time lasts 1/r messages on average."""
    loss_good: Annotated[float, Probability("loss_good")] = 0.0
    """Probability of loss in the good state (`tc netem`: 1 - k)."""
    loss_bad: Annotated[float, Probability("loss_bad")] = 1.0
    """Probability of loss in the bad state (`tc netem`: 1 - h)."""

    @property
    def transitions(self) -> tuple[tuple[float, ...], ...]:
        """Good, bad."""
        return ((1.0 - self.p, self.p), (self.r, 1.0 - self.r))

    @property
    def stationary(self) -> tuple[float, ...]:
        """Good, bad."""
        bad = self.p / (self.p + self.r)
        return (1.0 - bad, bad)

    @property
    def loss_in_state(self) -> tuple[float, ...]:
        """Good, bad."""
        return (self.loss_good, self.loss_bad)

    def relations(self) -> list[Problem]:
        """Return what its values ask of each other."""
        found = []
        if self.loss_good > self.loss_bad:
            text = f"{self.loss_good:g} is above loss_bad = {self.loss_bad:g}; swap them: the bad state loses more"
            found.append(Problem("loss_good", text))
        return found
