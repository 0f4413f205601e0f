r"""Losses of a link against its chain: how many, and how long the bursts.

For a chain with transitions P, stationary law pi and losses l (D1 = diag(l), D0 = 1 - D1):

- the share of n messages that is lost has mean :math:`\pi D_1 1` and variance
  :math:`\frac1n (\gamma_0 + 2 \sum_k (1 - k/n) \gamma_k)` with :math:`\gamma_k = \pi D_1 P^k D_1 1 - (\pi D_1 1)^2`;
  without memory that is the binomial law, and its exact test is used;
- a burst is l messages long with probability :math:`a (P D_1)^{l-1} P D_0 1 / (a 1)`, :math:`a = \pi D_0 P D_1`, which
  for Gilbert's case is geometric with r.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy import stats

from netem.check.rows import UNSEEN, Messages
from netem.models.chain import RESTART
from netem.models.loss import Bernoulli, LossModel

Finding = tuple[str, str, str, int, float | None]
"""What, configured, realised, n, p."""

FEWEST = 50
"""Fewer messages, bursts or pairs are not tested: nothing could be said of them."""

FEWEST_EXPECTED = 5.0
"""Chi-square needs so many in each class."""


def check_loss(sent: Messages, model: LossModel) -> list[Finding]:
    """Number of losses and length of bursts."""
    met = sent.those(~np.isin(sent.reason, list(UNSEEN)) & ~np.isinf(sent.delay))
    n, lost = len(met.seq), met.reason == "loss"
    configured = f"{model.rate:.4g}"
    if n < FEWEST:
        return [("loss", configured, f"too few messages to tell: {n}", n, None)]
    realised = f"{lost.mean():.4g}"
    if isinstance(model, Bernoulli):
        return [("loss", configured, realised, n, float(stats.binomtest(int(lost.sum()), n, model.p).pvalue))]
    spread = _spread(model, n)
    p = float(2 * stats.norm.sf(abs(lost.mean() - model.rate) / spread)) if spread else float(lost.mean() == model.rate)
    return [("loss", configured, realised, n, p), _bursts(met.seq, lost, model)]


def _spread(model: LossModel, n: int) -> float:
    """Standard deviation of the lost share of n messages."""
    P, pi, loss = np.array(model.transitions), np.array(model.stationary), np.array(model.loss_in_state)
    weights, later = pi * loss, loss.copy()
    total = model.rate * (1 - model.rate)
    for k in range(1, min(n, RESTART)):
        later = P @ later
        covariance = weights @ later - model.rate**2
        total += 2 * (1 - k / n) * covariance
        if abs(covariance) < 1e-12:
            break
    return float(np.sqrt(max(total, 0.0) / n))


def _bursts(seq: np.ndarray, lost: np.ndarray, model: LossModel) -> Finding:
    """Chi-square of the lengths of bursts that begin and end within what was seen."""
    lengths: list[int] = []
    length = 0  # of the burst so far; 0 outside of one, and in one of which the beginning was not seen
    for (before, was_lost), (number, is_lost) in pairwise(zip(seq.tolist(), lost.tolist(), strict=True)):
        if number != before + 1:
            length = 0
        elif is_lost:
            length += bool(length) or not was_lost
        else:
            lengths += [length] if length else []
            length = 0
    share = _burst_law(model)
    mean = float(np.arange(1, len(share) + 1) @ share)
    configured, n = f"mean {mean:.3g} messages", len(lengths)
    if n < FEWEST:
        return ("burst length", configured, f"too few bursts to tell: {n}", n, None)
    observed = np.bincount(np.minimum(lengths, len(share)), minlength=len(share) + 1)[1:].astype(float)
    observed, expected = _classes(observed, share * n)
    p = float(stats.chisquare(observed, expected).pvalue) if len(observed) > 1 else None
    return ("burst length", configured, f"mean {np.mean(lengths):.3g} messages", n, p)


def _burst_law(model: LossModel) -> np.ndarray:
    """Probability of each length from 1 on; the last one takes all longer ones."""
    P, pi, D1 = np.array(model.transitions), np.array(model.stationary), np.diag(model.loss_in_state)
    alive = pi @ (np.eye(len(pi)) - D1) @ P @ D1
    if alive.sum() <= 0.0:
        return np.ones(1)
    alive = alive / alive.sum()
    share: list[float] = []
    while alive.sum() > 1e-9 and len(share) < 10_000:
        after = alive @ P @ D1
        share.append(alive.sum() - after.sum())
        alive = after
    return np.array([*share, max(1.0 - sum(share), 0.0)])


def _classes(observed: np.ndarray, expected: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Neighbouring lengths together, until each class has enough."""
    sums: list[list[float]] = [[0.0, 0.0]]
    for one, other in zip(observed, expected, strict=True):
        if sums[-1][1] >= FEWEST_EXPECTED:
            sums.append([0.0, 0.0])
        sums[-1][0] += one
        sums[-1][1] += other
    if len(sums) > 1 and sums[-1][1] < FEWEST_EXPECTED:
        rest = sums.pop()
        sums[-1] = [sums[-1][0] + rest[0], sums[-1][1] + rest[1]]
    both = np.array(sums)
    return both[:, 0], both[:, 1] * both[:, 0].sum() / both[:, 1].sum()
