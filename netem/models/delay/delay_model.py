r"""What all delays have: FIFO or not; and what all random ones have: a quantile function, and correlation.

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

from netem.draws import Stream
from netem.models.chain import Chain
from wire.plausible import Plausible, in_percent

LONGEST_DELAY = 10.0
"""Delays above this (s) are taken for milliseconds by problem: control over such a link is not what netem is for."""

DELAY = Plausible("a delay", 0.0, LONGEST_DELAY)
"""Delay of one message (s)."""

STANDARD = NormalDist()
"""The standard normal law."""

Sampler = Callable[[int], float]
"""From a message number to its delay (s)."""


class DelayModel(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model"):
    """What every delay has."""

    fifo: bool = False
    """Whether messages keep their order: one that would overtake arrives together with the one before it."""

    def sampler(self, stream: Stream) -> Sampler:
        """How the delays (s) of one link are drawn."""
        raise NotImplementedError


class RandomDelay(DelayModel, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="model"):
    """What every delay from a law has."""

    correlation: Annotated[float, Plausible("a correlation", 0.0, 0.999999, hint=in_percent)] = 0.0
    """phi of the AR(1) process behind the draws, from 0 (independent) to below 1."""

    def quantile(self, u: float) -> float:
        """Delay (s) that a share u of all messages do not exceed, 0 < u < 1."""
        raise NotImplementedError

    def cdf(self, delay_s: float) -> float:
        """Share of messages whose delay does not exceed `delay_s`: the inverse of `quantile`."""
        raise NotImplementedError

    def sampler(self, stream: Stream) -> Sampler:
        """Draw one delay from one number of the stream."""
        quantile = self.quantile
        if not self.correlation:
            uniform = stream.uniform
            return lambda seq: quantile(uniform(seq))
        phi, rest = self.correlation, math.sqrt(1.0 - self.correlation**2)
        normal, share = stream.normal, STANDARD.cdf
        latent = Chain(normal, lambda x, seq: phi * x + rest * normal(seq))
        # The normal law ends, in doubles, at 8.3 standard deviations, where the quantile function is not defined.
        return lambda seq: quantile(min(max(share(latent.at(seq)), 2.0**-53), 1.0 - 2.0**-53))
