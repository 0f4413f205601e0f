"""Pareto delays: a tail so heavy that single messages come very late."""

from __future__ import annotations

from typing import Annotated

from netem.models.delay.delay_model import LONGEST_DELAY, RandomDelay
from wire.plausible import Plausible, Unit


class Pareto(RandomDelay, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="pareto"):
    r"""Pareto law of the first kind.

    .. math:: F^{-1}(u) = d_\min (1 - u)^{-1/a}, \qquad \mathrm{mean} = d_\min\, a / (a - 1)

    The variance is infinite for a <= 2, and so is the mean for a <= 1.
    """

    minimum_s: Annotated[float, Unit("s"), Plausible("the shortest delay", 0.0, LONGEST_DELAY, above_zero=True)]
    """d_min (s), shortest delay."""
    shape: Annotated[
        float, Plausible("a Pareto shape", 1.01, 100.0, hint="; at 1 and below the mean delay is infinite")
    ]
    """a: the smaller, the heavier the tail; 3 is a usual choice."""

    def quantile(self, u: float) -> float:
        """Delay (s) at share u."""
        return self.minimum_s * float((1.0 - u) ** (-1.0 / self.shape))

    def cdf(self, delay_s: float) -> float:
        """Share up to a delay (s)."""
        return 1.0 - float((self.minimum_s / delay_s) ** self.shape) if delay_s > self.minimum_s else 0.0
