r"""A test for each kind of fault: what a link did against its law.

**Losses** are counted, and so are bursts and bursts of one message. Without memory their number is binomial, else its
law is that of a count along the chain (`netem.check.count_law`), gaps in the messages' numbers and starts of the chain
included. So the tests hold at any number of messages, for rare and for long bursts.

**Delays** are compared exactly where nothing is drawn, else by Kolmogorov-Smirnov. Correlated delays are not
independent, which that test needs; but their normal scores :math:`x = \Phi^{-1}(F(d))` are an AR(1) process, whose
innovations :math:`e_n = (x_n - \varphi x_{n-1}) / \sqrt{1 - \varphi^2}` are. The correlation is tested by :math:`\sum
e_n \operatorname{sign} x_{n-1}`: given all before, each term is standard normal, so the sum is normal exactly, at any
number of messages. The usual estimate is so in the limit only; this test needs 3/2 as many messages for it (the square
of E|x| is 2/pi).

**A fault of the user's own** is asked again about each message that met it, and must answer as in the run. Its law is
known to its author alone, but its numbers are looked up by message, so it can be repeated. A fault that depends on
something else, which no other driver would repeat, is found by this too.
"""

from __future__ import annotations

import math
from typing import NoReturn

import numpy as np
import numpy.typing as npt
from scipy import special, stats

from netem.check.count_law import blocks, law, mean, tail
from netem.check.sent_messages import Array, SentMessages
from netem.draws import Stream
from netem.models import INSTANT
from netem.models.chain import RESTART
from netem.models.delay import Constant, DelayModel, RandomDelay, Trace
from netem.models.loss import Bernoulli, LossModel
from netem.models.own_fault import DROPPED_BY_OWN, judge_of
from netem.schema.fault import Span
from netem.schema.pattern import Link

Finding = tuple[str, str, str, int, float | None]
"""Name of the test, configured, realised, number of messages or bursts, p; see `netem.check.verify.LinkTest`."""

FEWEST = 50
"""Fewer messages are not tested: hardly anything could be said of them."""

FEWEST_BURSTS = 5.0
"""Bursts are only tested where as many are expected. Where as many are found would be a biased choice."""

AS_IT_SAYS = "as its judge says"
"""Configuration of a fault of the user's own."""


def check_share(what: str, count: int, n: int, p: float) -> Finding:
    """Compare a count among n messages with its probability."""
    if n < FEWEST:
        return (what, f"{p:.4g}", f"too few messages to tell: {n}", n, None)
    return (what, f"{p:.4g}", f"{count / n:.4g}", n, float(stats.binomtest(count, n, p).pvalue))


def check_gate(sent: SentMessages, span: Span) -> Finding:
    """Check that a cut lets nothing through; one that holds, and a flap, are not tested."""
    n = len(sent.seq)
    if span.kind == "flap" or span.model.hold:
        configured = "held" if span.model.hold else "up and down"
        return (span.kind, configured, "not tested: it depends on the time alone", n, None)
    through = int((sent.reason == "").sum())
    return (span.kind, "nothing passes", f"{through} passed", n, float(through == 0) if n else None)


# ---------------------------------------------------------------- loss


def check_loss(sent: SentMessages, model: LossModel) -> list[Finding]:
    """Compare the number of losses and of bursts."""
    met = sent.past_gates()
    n, lost = len(met.seq), met.reason == "loss"
    if n < FEWEST or isinstance(model, Bernoulli):
        return [check_share("loss", int(lost.sum()), n, model.rate)]
    parts = blocks(met.seq)
    p = tail(int(lost.sum()), *law("losses", model, parts))
    begun, alone = count_bursts(met.seq, lost)
    return [
        ("loss", f"{model.rate:.4g}", f"{lost.mean():.4g}", n, p),
        _bursts("bursts", begun, law("bursts", model, parts)),
        _bursts("bursts of one message", alone, law("single", model, parts)),
    ]


def _bursts(what: str, count: int, expected: tuple[int, Array]) -> Finding:
    configured = mean(*expected)
    if configured < FEWEST_BURSTS:
        return (what, f"{configured:.3g}", f"{count}; too few are expected to tell", count, None)
    return (what, f"{configured:.4g}", f"{count}", count, tail(count, *expected))


def count_bursts(seq: np.ndarray, lost: np.ndarray) -> tuple[int, int]:
    """Return the bursts whose beginning was seen, and those of one message, after which the next came through.

    Examples
    --------
    >>> number, fate = np.arange(10), np.array([1, 1, 0, 1, 0, 1, 1, 0, 0, 1], dtype=bool)
    >>> count_bursts(number, fate)
    (3, 1)
    """
    joined = _joined(seq)
    begins = ~lost[:-1] & lost[1:] & joined
    return int(begins.sum()), int((begins[:-1] & ~lost[2:] & joined[1:]).sum())


def _joined(seq: np.ndarray) -> npt.NDArray[np.bool_]:
    """Return which messages follow the one before them along the chain."""
    joined: npt.NDArray[np.bool_] = (np.diff(seq) == 1) & (seq[1:] % RESTART != 0)
    return joined


# ---------------------------------------------------------------- delay


def check_delay(sent: SentMessages, model: DelayModel, stream: Stream) -> list[Finding]:
    """Compare the delays of the first copies; `stream` says where a trace starts."""
    met = sent.arrived()
    n = len(met.seq)
    if isinstance(model, (Constant, Trace)):
        sampler = model.sampler(stream)
        return [_exact(met.delay, np.array([sampler(int(seq)) for seq in met.seq]))]
    assert isinstance(model, RandomDelay)
    mean_delay = np.mean([model.quantile((i + 0.5) / 500) for i in range(500)])
    configured = f"{model.__struct_config__.tag}, mean {mean_delay:.4g} s"
    if n < FEWEST:
        return [("delay", configured, f"too few messages to tell: {n}", n, None)]
    shares = np.array([model.cdf(delay) for delay in met.delay])
    realised, phi = f"mean {met.delay.mean():.4g} s", model.correlation
    if not phi:
        return [("delay", configured, realised, n, float(stats.kstest(shares, "uniform").pvalue))]
    scores = special.ndtri(np.clip(shares, 2.0**-53, 1 - 2.0**-53))
    follows = _joined(met.seq)
    old, new, pairs = scores[:-1][follows], scores[1:][follows], int(follows.sum())
    if pairs < FEWEST:
        return [("delay", configured, f"too few messages in a row to tell: {pairs}", pairs, None)]
    innovations = (new - phi * old) / math.sqrt(1 - phi**2)
    estimate = float((old * new).sum() / (old * old).sum())
    off = float((innovations * np.sign(old)).sum()) / math.sqrt(pairs)
    return [
        ("delay", configured, realised, pairs, float(stats.kstest(innovations, "norm").pvalue)),
        ("delay correlation", f"{phi:g}", f"{estimate:.3g}", pairs, float(2 * stats.norm.sf(abs(off)))),
    ]


def _exact(delays: Array, expected: Array) -> Finding:
    n = len(delays)
    if not n:
        return ("delay", "exactly as configured", "no message to tell", 0, None)
    off = np.abs(delays - expected).max()
    text = f"exactly, {n} times" if off <= INSTANT else f"off by up to {off:.3g} s"
    return ("delay", f"{expected.mean():.4g} s, exactly", text, n, float(off <= INSTANT))


# ---------------------------------------------------------------- a fault of the user's own


class _Size:
    """Size of a message, which is not recorded: a fault that looks at it fails, and so is not tested."""

    def _refuse(self, *of: object) -> NoReturn:
        raise LookupError

    __bool__ = __eq__ = __float__ = __hash__ = __index__ = _refuse


def added_by(sent: SentMessages, span: Span, link: Link, seed: int) -> tuple[Array, str]:
    """Return the delay (s) that a fault adds to each message, NaN where it drops it; and why it cannot be asked, or "".

    To messages that never met it, because a cut or loss dropped them or it did not hold, it adds nothing.
    """
    failed: list[str] = []
    judge, size = judge_of(span.model, *link, Stream(seed, *link, span.kind), failed.append), _Size()
    met = np.isin(sent.seq, _met_by_own(sent).seq)
    met &= (sent.t + INSTANT >= span.from_s) & (sent.t + INSTANT < span.to_s)
    added = np.zeros(len(sent.seq))
    for i in np.flatnonzero(met).tolist():
        delay = judge(int(sent.seq[i]), float(sent.t[i]), size)  # type: ignore[arg-type]
        added[i] = math.nan if delay is None else delay
    return added, "it fails, or looks at the size of a message, which is not recorded" if failed else ""


def check_own(sent: SentMessages, span: Span, link: Link, seed: int, *, alone: bool) -> Finding:
    """Compare which messages a fault dropped with its judge now and, where it is alone, their delays."""
    met = _met_by_own(sent)
    added, why = added_by(met, span, link, seed)
    n = len(met.seq)
    if why or not n:
        return (span.kind, AS_IT_SAYS, f"not tested: {why or 'no message met it'}", n, None)
    dropped = met.reason == DROPPED_BY_OWN
    otherwise = dropped != np.isnan(added)
    if alone:
        otherwise |= ~dropped & ~(np.abs(met.delay - added) <= INSTANT)
    text = f"otherwise for {otherwise.sum()} of {n}" if otherwise.any() else f"the same, {n} times"
    return (span.kind, AS_IT_SAYS, text, n, float(not otherwise.any()))


def _met_by_own(sent: SentMessages) -> SentMessages:
    met = sent.past_gates()
    return met.those(met.reason != "loss")
