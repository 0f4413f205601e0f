"""Pareto delays: a tail so heavy that single messages come very late."""

from __future__ import annotations

from netem.models.delay.delay_model import RandomDelay
from netem.netem_errors import Mistake, amount, seconds
from netem.plausible_links import Range


class Pareto(RandomDelay, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="pareto"):
    r"""Pareto law of the first kind.

    .. math:: F^{-1}(u) = d_\min (1 - u)^{-1/a}, \qquad \mathrm{mean} = d_\min\, a / (a - 1)

    The variance is infinite for a <= 2, and so is the mean for a <= 1.
    """

    minimum_s: float
    """d_min (s), shortest delay."""
    shape: float
    """a: the smaller, the heavier the tail; 3 is a usual choice."""

    def quantile(self, u: float) -> float:
        """Delay (s) at share u."""
        return self.minimum_s * float((1.0 - u) ** (-1.0 / self.shape))

    def cdf(self, delay_s: float) -> float:
        """Share up to a delay (s)."""
        return 1.0 - float((self.minimum_s / delay_s) ** self.shape) if delay_s > self.minimum_s else 0.0

    def mistakes(self) -> list[Mistake]:
        """Values that cannot be meant."""
        found = seconds("minimum_s", self.minimum_s, "the shortest delay", above_zero=True)
        hint = "; at 1 and below the mean delay is infinite"
        found += amount("shape", self.shape, Range("a Pareto shape", "", 1.01, 100.0), hint)
        return found + self._wrong_correlation()
