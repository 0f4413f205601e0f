"""Lognormal delays: many short ones and a tail, as queues on shared networks give."""

from __future__ import annotations

import math
from typing import Annotated

from netem.models.delay.delay_model import DELAY, LONGEST_DELAY, STANDARD, RandomDelay
from wire.plausible import Plausible, Unit


class Lognormal(RandomDelay, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model", tag="lognormal"):
    r"""Lognormal law above a floor.

    .. math:: F^{-1}(u) = d_0 + m \exp(\sigma \Phi^{-1}(u)), \qquad \mathrm{mean} = d_0 + m\, e^{\sigma^2/2}
    """

    median_s: Annotated[float, Unit("s"), Plausible("a median delay", 0.0, LONGEST_DELAY, above_zero=True)]
    """m (s): half of the messages are delayed by less than offset_s + median_s."""
    sigma: Annotated[float, Plausible("sigma", 0.001, 3.0, hint="; it is the spread of the logarithm, without a unit")]
    """Standard deviation of the delay's logarithm; 0.5 is a moderate tail, 1 a long one."""
    offset_s: Annotated[float, Unit("s"), DELAY] = 0.0
    """d_0 (s): delay that every message has, e.g. propagation."""

    def quantile(self, u: float) -> float:
        """Delay (s) at share u."""
        return self.offset_s + self.median_s * math.exp(self.sigma * STANDARD.inv_cdf(u))

    def cdf(self, delay_s: float) -> float:
        """Share up to a delay (s)."""
        above = delay_s - self.offset_s
        return STANDARD.cdf(math.log(above / self.median_s) / self.sigma) if above > 0.0 else 0.0
