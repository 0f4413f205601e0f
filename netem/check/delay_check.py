r"""Delays of a link against their law: exactly where nothing is drawn, else Kolmogorov-Smirnov.

Correlated delays are not independent, which the test needs; but their normal scores :math:`x = \Phi^{-1}(F(d))` are an
AR(1) process, whose innovations :math:`e_n = (x_n - \varphi x_{n-1}) / \sqrt{1 - \varphi^2}` are.

The correlation is tested by :math:`\sum e_n \operatorname{sign} x_{n-1}`: given all before, each term is standard
normal, so the sum is normal exactly, at any number of messages. The usual estimate is so in the limit only; this test
needs 3/2 as many messages for it (the square of E|x| is 2/pi).
"""

from __future__ import annotations

import math

import numpy as np
from scipy import special, stats

from netem.check.loss_check import FEWEST, Finding
from netem.check.rows import Messages
from netem.draws import Stream
from netem.models import INSTANT
from netem.models.chain import RESTART
from netem.models.delay import Constant, DelayModel, RandomDelay, Trace


def check_delay(sent: Messages, model: DelayModel, stream: Stream) -> list[Finding]:
    """Delays of the first copies; `stream` tells where a trace starts."""
    met = sent.those(np.isfinite(sent.delay))
    n = len(met.seq)
    if isinstance(model, (Constant, Trace)):
        sampler = model.sampler(stream)
        told = np.array([sampler(int(seq)) for seq in met.seq])
        return [_exact("delay", met.delay, told)]
    assert isinstance(model, RandomDelay)
    mean = np.mean([model.quantile((i + 0.5) / 500) for i in range(500)])
    configured = f"{model.__struct_config__.tag}, mean {mean:.4g} s"
    if n < FEWEST:
        return [("delay", configured, f"too few messages to tell: {n}", n, None)]
    shares = np.array([model.cdf(delay) for delay in met.delay])
    realised = f"mean {met.delay.mean():.4g} s"
    if not model.correlation:
        return [("delay", configured, realised, n, float(stats.kstest(shares, "uniform").pvalue))]
    scores = special.ndtri(np.clip(shares, 2.0**-53, 1 - 2.0**-53))
    follows = (np.diff(met.seq) == 1) & (met.seq[1:] % RESTART != 0)
    old, new = scores[:-1][follows], scores[1:][follows]
    phi, pairs = model.correlation, int(follows.sum())
    if pairs < FEWEST:
        return [("delay", configured, f"too few messages in a row to tell: {pairs}", pairs, None)]
    innovations = (new - phi * old) / math.sqrt(1 - phi**2)
    found = float((old * new).sum() / (old * old).sum())
    off = float((innovations * np.sign(old)).sum()) / math.sqrt(pairs)
    return [
        ("delay", configured, realised, pairs, float(stats.kstest(innovations, "norm").pvalue)),
        ("delay correlation", f"{phi:g}", f"{found:.3g}", pairs, float(2 * stats.norm.sf(abs(off)))),
    ]


def _exact(what: str, found: np.ndarray, told: np.ndarray) -> Finding:
    if not len(found):
        return (what, "exactly as told", "no message to tell", 0, None)
    off = np.abs(found - told)
    text = f"exactly, {len(found)} times" if off.max() <= INSTANT else f"off by up to {off.max():.3g} s"
    return (what, f"{told.mean():.4g} s, exactly", text, len(found), float(off.max() <= INSTANT))
