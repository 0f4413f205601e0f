r"""Losses of a link against its law: how many, how many bursts, how many bursts of one message.

All three are counted exactly as they are distributed: without memory by the binomial law, else along the chain
(`netem.check.count_law`), gaps in the messages' numbers and starts of the chain included. So the tests hold at any
number of messages, for rare and for long bursts.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from netem.check.count_law import Array, blocks, law, mean, tail
from netem.check.rows import UNSEEN, Messages
from netem.models.chain import RESTART
from netem.models.loss import Bernoulli, LossModel

Finding = tuple[str, str, str, int, float | None]
"""What, configured, realised, n, p."""

FEWEST = 50
"""Fewer messages are not tested: hardly anything could be said of them."""

FEWEST_BURSTS = 5.0
"""Bursts are only tested where as many are expected. What is found must not decide it: the test would be biased."""


def check_loss(sent: Messages, model: LossModel) -> list[Finding]:
    """Number of losses and of bursts."""
    met = sent.those(~np.isin(sent.reason, list(UNSEEN)) & ~np.isinf(sent.delay))
    n, lost = len(met.seq), met.reason == "loss"
    configured = f"{model.rate:.4g}"
    if n < FEWEST:
        return [("loss", configured, f"too few messages to tell: {n}", n, None)]
    realised = f"{lost.mean():.4g}"
    if isinstance(model, Bernoulli):
        return [("loss", configured, realised, n, float(stats.binomtest(int(lost.sum()), n, model.p).pvalue))]
    parts = blocks(met.seq)
    found = ("loss", configured, realised, n, tail(int(lost.sum()), *law("losses", model, parts)))
    begun, alone = count_bursts(met.seq, lost)
    return [
        found,
        _bursts("bursts", begun, law("bursts", model, parts)),
        _bursts("bursts of one message", alone, law("single", model, parts)),
    ]


def _bursts(what: str, found: int, expected: tuple[int, Array]) -> Finding:
    told = mean(*expected)
    if told < FEWEST_BURSTS:
        return (what, f"{told:.3g}", f"{found}; too few are expected to tell", found, None)
    return (what, f"{told:.4g}", f"{found}", found, tail(found, *expected))


def count_bursts(seq: np.ndarray, lost: np.ndarray) -> tuple[int, int]:
    """Bursts of which the beginning was seen, and those of them that were one message long, which came through after.

    Examples
    --------
    >>> number, fate = np.arange(10), np.array([1, 1, 0, 1, 0, 1, 1, 0, 0, 1], dtype=bool)
    >>> count_bursts(number, fate)
    (3, 1)
    """
    joined = (np.diff(seq) == 1) & (seq[1:] % RESTART != 0)
    begins = ~lost[:-1] & lost[1:] & joined
    return int(begins.sum()), int((begins[:-1] & ~lost[2:] & joined[1:]).sum())
