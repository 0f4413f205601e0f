"""Lognormal delays: many short ones and a tail, as queues on shared networks give."""

from __future__ import annotations

import math

from netem.models.delay.delay_model import STANDARD, RandomDelay
from netem.netem_errors import Mistake, amount, seconds
from netem.plausible_links import Range


class Lognormal(RandomDelay, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="lognormal"):
    r"""Lognormal law above a floor.

    .. math:: F^{-1}(u) = d_0 + m \exp(\sigma \Phi^{-1}(u)), \qquad \mathrm{mean} = d_0 + m\, e^{\sigma^2/2}
    """

    median_s: float
    """m (s): half of the messages are delayed by less than offset_s + median_s."""
    sigma: float
    """Standard deviation of the delay's logarithm; 0.5 is a moderate tail, 1 a long one."""
    offset_s: float = 0.0
    """d_0 (s): delay that every message has, e.g. propagation."""

    def quantile(self, u: float) -> float:
        """Delay (s) at share u."""
        return self.offset_s + self.median_s * math.exp(self.sigma * STANDARD.inv_cdf(u))

    def cdf(self, delay_s: float) -> float:
        """Share up to a delay (s)."""
        above = delay_s - self.offset_s
        return STANDARD.cdf(math.log(above / self.median_s) / self.sigma) if above > 0.0 else 0.0

    def mistakes(self) -> list[Mistake]:
        """Values that cannot be meant."""
        found = seconds("median_s", self.median_s, "a median delay", above_zero=True)
        found += seconds("offset_s", self.offset_s, "a delay")
        hint = "; it is the spread of the logarithm, without a unit"
        return found + amount("sigma", self.sigma, Range("sigma", "", 0.001, 3.0), hint) + self._wrong_correlation()
