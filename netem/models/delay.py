r"""Delays of single messages: constant, from a law, or measured. Each may keep the order of messages (FIFO).

A random delay of message n is :math:`d_n = F^{-1}(u_n)`. Without correlation the u_n are independent. With correlation
:math:`\varphi` they come from a normal AR(1) process in the message number,

.. math:: x_n = \varphi x_{n-1} + \sqrt{1-\varphi^2}\, z_n, \qquad u_n = \Phi(x_n),

so that whatever the law F, every single delay keeps it exactly, and neighbours in number are alike (Cario, Nelson 1996,
"ARTA"). `tc netem` mixes u_n and u_{n-1} linearly instead, which does not keep the law.

References
----------
Cario, Nelson, Operations Research Letters 19 (1996) 51-58. https://doi.org/10.1016/0167-6377(96)00017-X
"""

from __future__ import annotations

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import Annotated

import msgspec

from gridpeers.netem.draws import Chain, Stream
from gridpeers.wire.schema.table_schema import Below, Plausible, Problem, Unit, in_percent

LONGEST_DELAY = 10.0  # Longest plausible delay (s); a larger number is probably in milliseconds

DELAY = Plausible("a delay", 0.0, LONGEST_DELAY)

STANDARD = NormalDist()

Sampler = Callable[[int], float]


class DelayModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model"):
    fifo: bool = False
    """true: messages keep their order; one that would overtake arrives together with the one before it."""

    def sampler(self, stream: Stream) -> Sampler:
        """Return the delays (s) of one link by message number."""
        raise NotImplementedError


class RandomDelay(DelayModel, frozen=True, kw_only=True):
    correlation: Annotated[float, Plausible("a correlation", 0.0, 0.999999, hint=in_percent)] = 0.0
    """phi of the AR(1) process behind the draws, from 0 (independent) to below 1."""

    def quantile(self, u: float) -> float:
        """Return the delay (s) that a share u of all messages do not exceed, 0 < u < 1."""
        raise NotImplementedError

    def sampler(self, stream: Stream) -> Sampler:
        quantile = self.quantile
        if not self.correlation:
            uniform = stream.uniform
            return lambda seq: quantile(uniform(seq))
        phi, rest = self.correlation, math.sqrt(1.0 - self.correlation**2)
        normal, share = stream.normal, STANDARD.cdf
        latent = Chain(normal, lambda x, seq: phi * x + rest * normal(seq))
        # The normal law ends, in doubles, at 8.3 standard deviations, where the quantile function is not defined.
        return lambda seq: quantile(min(max(share(latent.at(seq)), 2.0**-53), 1.0 - 2.0**-53))


class Constant(DelayModel, frozen=True, kw_only=True, tag="constant"):
    """Delay d for every message; in a file `delay = 0.1` means the same."""

    delay_s: Annotated[float, Unit("s"), DELAY]
    """d (s)."""

    def sampler(self, stream: Stream) -> Sampler:
        delay_s = self.delay_s
        return lambda seq: delay_s


class Uniform(RandomDelay, frozen=True, kw_only=True, tag="uniform"):
    """Delay uniform on (low, high): F^-1(u) = low + u (high - low)."""

    low_s: Annotated[float, Unit("s"), DELAY, Below("high_s")]
    """Shortest delay (s)."""
    high_s: Annotated[float, Unit("s"), DELAY]
    """Longest delay (s)."""

    def quantile(self, u: float) -> float:
        return self.low_s + u * (self.high_s - self.low_s)


class Normal(RandomDelay, frozen=True, kw_only=True, tag="normal"):
    r"""Normal law, truncated at 0 (the law given that the delay is not negative, not a heap of zeros).

    .. math:: F^{-1}(u) = \mu + \sigma \Phi^{-1}(c + u (1 - c)), \qquad c = \Phi(-\mu / \sigma)

    With mu above 3 sigma the truncation moves mean and spread by less than half a percent of sigma.
    """

    mean_s: Annotated[float, Unit("s"), Plausible("a mean delay", 0.0, LONGEST_DELAY)]
    """mu (s), mean before the truncation."""
    std_s: Annotated[float, Unit("s"), Plausible("the spread of a delay", 0.0, LONGEST_DELAY, above_zero=True)]
    """sigma (s), standard deviation before the truncation: the jitter."""

    def quantile(self, u: float) -> float:
        below = STANDARD.cdf(-self.mean_s / self.std_s)
        # from the upper side, where 1 - c is exact: c + u (1 - c) would round to 1 for u next to 1
        return max(self.mean_s - self.std_s * STANDARD.inv_cdf((1.0 - u) * (1.0 - below)), 0.0)


class Lognormal(RandomDelay, frozen=True, kw_only=True, tag="lognormal"):
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
        return self.offset_s + self.median_s * math.exp(self.sigma * STANDARD.inv_cdf(u))


class Pareto(RandomDelay, frozen=True, kw_only=True, tag="pareto"):
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
        return self.minimum_s * float((1.0 - u) ** (-1.0 / self.shape))


class Trace(DelayModel, frozen=True, kw_only=True, tag="trace"):
    """Message n has delay number (n + start) mod length of the trace.

    In a scenario `file` names a CSV file with a column `delay_s`; `gridpeers.netem.schema.trace_file` reads it into
    `delays_s`, so that an agent's configuration needs no file.
    """

    file: str = ""
    """Path of the CSV file, relative to the scenario."""
    delays_s: tuple[float, ...] = ()
    """The delays (s), in the order of the messages."""
    spread: bool = True
    """true: each link starts at a random row of its own; false: all links have the same delay at once."""

    def sampler(self, stream: Stream) -> Sampler:
        delays = self.delays_s
        start = stream.below(len(delays), 0) if self.spread else 0
        return lambda seq: delays[(seq + start) % len(delays)]

    def relations(self) -> list[Problem]:
        if not self.delays_s:
            return [] if self.file else [Problem("", 'a trace needs delays: write file = "delays.csv"')]
        for i, delay_s in enumerate(self.delays_s):
            if text := DELAY.objection(delay_s, "s"):
                return [Problem(f"delays_s[{i}]", text)]  # one is enough: each row of a file is checked as it is read
        return []


AnyDelay = Constant | Uniform | Normal | Lognormal | Pareto | Trace  # Every delay a scenario may name
