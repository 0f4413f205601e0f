"""Normal delays, of which none is negative."""

from __future__ import annotations

from typing import Annotated

from netem.models.delay.delay_model import LONGEST_DELAY, STANDARD, RandomDelay
from wire.plausible import Plausible, Unit


class Normal(RandomDelay, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="normal"):
    r"""Normal law, truncated at 0 (the law given that the delay is not negative, not a heap of zeros).

    .. math:: F^{-1}(u) = \mu + \sigma \Phi^{-1}(c + u (1 - c)), \qquad c = \Phi(-\mu / \sigma)

    With mu above 3 sigma the truncation moves mean and spread by less than half a percent of sigma.
    """

    mean_s: Annotated[float, Unit("s"), Plausible("a mean delay", 0.0, LONGEST_DELAY)]
    """mu (s), mean before the truncation."""
    std_s: Annotated[float, Unit("s"), Plausible("the spread of a delay", 0.0, LONGEST_DELAY, above_zero=True)]
    """sigma (s), standard deviation before the truncation: the jitter."""

    def quantile(self, u: float) -> float:
        """Delay (s) at share u."""
        below = STANDARD.cdf(-self.mean_s / self.std_s)
        # from the upper side, where 1 - c is exact: c + u (1 - c) would round to 1 for u next to 1
        return max(self.mean_s - self.std_s * STANDARD.inv_cdf((1.0 - u) * (1.0 - below)), 0.0)

    def cdf(self, delay_s: float) -> float:
        """Share up to a delay (s)."""
        above = STANDARD.cdf(self.mean_s / self.std_s)
        return 1.0 - STANDARD.cdf((self.mean_s - delay_s) / self.std_s) / above if delay_s > 0.0 else 0.0
