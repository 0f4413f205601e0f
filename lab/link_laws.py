r"""Check on request: do emulated links lose, delay, copy and corrupt messages by the laws of their entries.

Every statistic has its exact law, so the check holds for 5 messages as for 50 000. The number K of marked steps of a
chain (losses, or bursts that begin), A(z) = plain + z marked, has the generating function :math:`E[z^K] = v A(z)^n 1`,
which an FFT turns back from the roots of unity. Correlated delays have normal scores :math:`x = \Phi^{-1}(F(d))`, an
AR(1) process: its innovations e are independent, and each :math:`e_n \operatorname{sign} x_{n-1}` is standard normal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import special, stats

from gridpeers.netem.draws import RESTART, Stream
from gridpeers.netem.fault_schedule import GATES
from gridpeers.netem.ledger import LinkTrace, Outcome, copies_of
from gridpeers.netem.models import INSTANT
from gridpeers.netem.models.delay import Constant, Lognormal, Normal, Pareto, RandomDelay, Trace, Uniform
from gridpeers.netem.models.loss import Bernoulli, LossModel
from gridpeers.netem.models.own_fault import DROPPED_BY_OWN, judge_of
from gridpeers.netem.schema.fault import Span
from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.pattern import Link
from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.wire.plugins.plugin import Plugin
from gridpeers.wire.schema.table_schema import Range

MASKS = ("rate", "slots")  # add to a delay, so that its law cannot be seen alone

_LAWS: dict[type[RandomDelay], Callable[[Any], Any]] = {
    Uniform: lambda of: stats.uniform(of.low_s, of.high_s - of.low_s),
    Normal: lambda of: stats.truncnorm(-of.mean_s / of.std_s, math.inf, of.mean_s, of.std_s),
    Lognormal: lambda of: stats.lognorm(of.sigma, of.offset_s, of.median_s),
    Pareto: lambda of: stats.pareto(of.shape, 0.0, of.minimum_s),
}

_Sent = np.recarray[Any, Any]
_COLUMNS = [("seq", "i8"), ("t", "f8"), ("reason", "U16"), ("delay", "f8"), ("copies", "i8"), ("flipped", "i8")]
"""Messages of a link, each once: why it was dropped ("" if it was not), delay (s) of the first copy, NaN if dropped."""

Finding = tuple[Any, ...]  # of a LinkTest, without the link
Blocks = tuple[tuple[tuple[int, int], ...], ...]
"""For each start of the chain, its runs of messages without a gap: distance of the first from the start, and length."""


class LinkTest(NamedTuple):
    link: Link
    what: str
    configured: str
    realised: str
    n: int = 0
    p: float | None = None
    """Probability that chance alone is as far off; 0 or 1 where nothing is left to chance, None if not tested."""


class LinkLaws(Check):
    """Emulated links lose, delay, copy and corrupt messages by the laws of their entries."""

    level: Annotated[float, Range(1e-9, 0.5)] = 0.001
    """Probability that a sound run has any violation, however many links it has (Holm 1979)."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        _ = case.communication  # says why there is no record
        assert case.folder is not None
        record = RunRecord.open(case.folder)
        if any(request.seq for request in record.link_requests()):
            raise NotJudgedError("links were changed by hand; run and check its replay.toml")
        if not (tree := record.info.plant.links):
            raise NotJudgedError("the run has no emulated links")
        config = EmulationConfig.of_tree(tree)
        tests = link_tests(record.links(), config.netem, config.microgrids)
        if all(test.p is None for test in tests):
            raise NotJudgedError("no emulated link can be tested")
        for test in improbable(tests, self.level):
            text = f"{test.link}, {test.n} messages: {test.what} is {test.realised}, configured {test.configured}"
            yield Violation(text=f"{text}; by chance", agent=test.link.dst, value=test.p, limit=self.level)


def link_tests(traces: Iterable[LinkTrace], netem: Netem, microgrids: Mapping[str, str]) -> list[LinkTest]:
    """Return the tests of all links that had messages: verdicts of all receivers beside the entries of a run."""
    by_link: dict[Link, list[LinkTrace]] = {}
    for trace in traces:
        by_link.setdefault(Link(trace.src, trace.dst), []).append(trace)
    return [
        LinkTest(link, *found)
        for link in sorted(by_link)
        for spans in [netem.spans(link, microgrids)]
        for span in spans
        for found in _tests(_sent(by_link[link], span), span, spans, Stream(netem.seed, *link, span.kind), link)
    ]


def improbable(tests: Sequence[LinkTest], level: float) -> list[LinkTest]:
    """Return the tests that fail, the least probable first, where any may fail by chance with probability `level`."""
    tested = sorted((test for test in tests if test.p is not None), key=lambda test: test.p or 0.0)
    failing = [(test.p or 0.0) <= level / (len(tested) - rank) for rank, test in enumerate(tested)]
    return tested[: (*failing, False).index(False)]


def _sent(traces: Sequence[LinkTrace], span: Span) -> _Sent:
    """Return the messages sent while an entry held, by number; of one that was judged twice, the last verdict."""
    last: dict[int, tuple[float, Outcome]] = {}
    for trace in traces:
        for seq, t, outcome in zip(trace.seq, trace.t, trace.outcome, strict=True):
            if span.from_s <= t + INSTANT < span.to_s:
                last[seq] = t, outcome
    rows = []
    for seq, (t, outcome) in sorted(last.items()):
        copies = copies_of(outcome)
        reason, delay = (outcome, math.nan) if isinstance(outcome, str) else ("", copies[0][0])
        rows.append((seq, t, reason, delay, len(copies), sum(bit is not None for _, bit in copies)))
    return np.array(rows, dtype=_COLUMNS).view(np.recarray)


def _tests(sent: _Sent, span: Span, others: Sequence[Span], stream: Stream, link: Link) -> list[Finding]:
    kind, model = span.kind, span.model
    beside = [o for o in others if o is not span and o.from_s < span.to_s and span.from_s < o.to_s]
    if kind in MASKS or kind == "flap" or (kind in GATES and model.hold):
        return []
    if kind in GATES:
        through = int((sent.reason == "").sum())
        return [(kind, "nothing passes", f"{through} passed", len(sent), float(through == 0))]
    met = sent[~np.isin(sent.reason, GATES) & ~np.isinf(sent.delay)]
    if kind == "loss":
        return _loss_tests(met, model)
    if isinstance(model, Plugin):
        return [_own_test(met[met.reason != "loss"], span, beside, stream, link)]
    arrived = sent[np.isfinite(sent.delay)]
    if kind == "duplicate":
        return [_share(kind, int((arrived.copies - 1).sum()), len(arrived.seq), model.p)]
    if kind == "corrupt":
        return [_share(kind, int(arrived.flipped.sum()), int(arrived.copies.sum()), model.p)]
    masks = [it.kind for it in beside if it.kind in MASKS or isinstance(it.model, Plugin)]
    masks += [it.kind for it in beside if it.kind in GATES and it.model.hold] + ["fifo"] * model.fifo
    if masks or not len(arrived):
        return [("delay", model.__struct_config__.tag, f"not tested: {' and '.join(masks) or 'no message'} on it")]
    return _delay_tests(arrived, model, stream)


def _share(what: str, count: int, n: int, p: float) -> Finding:
    return (what, f"{p:.4g}", f"that of {count} of {n}", n, float(stats.binomtest(count, n, p).pvalue) if n else None)


def _loss_tests(met: _Sent, model: LossModel) -> list[Finding]:
    n, lost = len(met.seq), met.reason == "loss"
    if not n or isinstance(model, Bernoulli):
        return [_share("loss", int(lost.sum()), n, model.rate)]
    blocks = blocks_of(met.seq)
    begun = ~lost[:-1] & lost[1:] & _joined(met.seq)
    found = [("loss", f"{model.rate:.4g}", f"{lost.mean():.4g}", n, _tail(int(lost.sum()), law(model, blocks)))]
    bursts = law(model, blocks, bursts=True)
    expected = float(np.arange(n + 1) @ bursts)
    if expected >= 5.0:  # where as many are found would be a biased choice
        found.append(("bursts", f"{expected:.4g}", f"{begun.sum()}", n, _tail(int(begun.sum()), bursts)))
    return found


def _joined(seq: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    return np.asarray((np.diff(seq) == 1) & (seq[1:] % RESTART != 0))


def blocks_of(seq: npt.NDArray[np.int64]) -> Blocks:
    blocks: dict[int, list[tuple[int, int]]] = {}
    for run in np.split(seq, np.flatnonzero(~_joined(seq)) + 1):
        block, first = divmod(int(run[0]), RESTART)
        blocks.setdefault(block, []).append((first, len(run)))
    return tuple(map(tuple, blocks.values()))


@lru_cache(maxsize=64)
def law(model: LossModel, blocks: Blocks, *, bursts: bool = False) -> npt.NDArray[np.float64]:
    """Return the probabilities of 0, 1, ... lost messages, or of so many bursts whose beginning was seen."""
    n = sum(length for block in blocks for _, length in block)
    P, pi, loss = np.array(model.transitions), np.array(model.stationary), np.array(model.loss_in_state)
    kept, lost, both = np.diag(1.0 - loss), np.diag(loss), np.vstack([np.eye(len(pi))] * 2)
    found = []
    for z in np.array_split(np.exp(2j * np.pi * np.arange((n + 1) // 2 + 1) / (n + 1)), n // 4096 + 1):
        begins = z[:, None, None]
        goes_on = np.ones_like(begins) if bursts else begins
        # states of the counter: those of the chain after a message that came, and after one that was lost
        enter, came, gone = (
            np.concatenate([move @ kept + 0.0 * mark, mark * (move @ lost)], axis=2)
            for move, mark in ((np.eye(len(pi)), goes_on), (P, begins), (P, goes_on))
        )
        step, product = np.concatenate([came, gone], axis=1), np.ones(len(z), complex)
        for block in set(blocks):
            state, last = np.broadcast_to(pi.astype(complex), (len(z), 1, len(pi))), -1
            for first, length in block:
                if last >= 0:
                    state = state @ both @ np.linalg.matrix_power(P, first - last)
                state, last = state @ enter @ np.linalg.matrix_power(step, length - 1), first + length - 1
            product *= state.sum(axis=(1, 2)) ** blocks.count(block)
        found.append(product)
    return np.maximum(np.fft.irfft(np.concatenate(found).conj(), n + 1), 0.0)


def _tail(count: int, probabilities: npt.NDArray[np.float64]) -> float:
    """Return the probability of a count as far out as this one: twice the smaller side, so never too small."""
    return float(min(1.0, 2.0 * min(probabilities[: count + 1].sum(), probabilities[count:].sum())))


def _delay_tests(met: _Sent, model: Constant | Trace | RandomDelay, stream: Stream) -> list[Finding]:
    if not isinstance(model, RandomDelay):
        sampler = model.sampler(stream)
        off = np.abs(met.delay - np.array([sampler(int(seq)) for seq in met.seq])).max(initial=0.0)
        return [("delay", "as its model says", f"up to {off:.3g} s off", len(met), float(off <= INSTANT))]
    name = model.__struct_config__.tag
    shares, phi = _LAWS[type(model)](model).cdf(met.delay), model.correlation
    realised = f"mean {met.delay.mean():.4g} s"
    if not phi:
        return [("delay", name, realised, len(met), float(stats.kstest(shares, "uniform").pvalue))]
    scores, follows = special.ndtri(np.clip(shares, 2.0**-53, 1 - 2.0**-53)), _joined(met.seq)
    old, innovations = scores[:-1][follows], (scores[1:] - phi * scores[:-1])[follows] / math.sqrt(1 - phi**2)
    if not (pairs := len(old)):
        return [("delay", name, "not tested: no two messages in a row")]
    drift = float(innovations @ np.sign(old)) / math.sqrt(pairs)
    p, p_drift = float(stats.kstest(innovations, "norm").pvalue), float(2.0 * stats.norm.sf(abs(drift)))
    return [("delay", name, realised, pairs, p), ("delay correlation", f"{phi:g}", "another", pairs, p_drift)]


def _own_test(met: _Sent, span: Span, beside: Sequence[Span], stream: Stream, link: Link) -> Finding:
    """Compare the messages that a fault dropped with the answers of its judge now; if it acts alone, delays too."""
    told = "as its judge says"
    if others := [o.kind for o in beside if isinstance(o.model, Plugin)]:
        return (span.kind, told, f"not tested: {' and '.join(others)} on it")
    failed: list[str] = []
    judge, size = judge_of(span.model, *link, stream, failed.append), object()  # sizes are not recorded
    answers = [judge(int(seq), float(t), size) for seq, t in zip(met.seq, met.t, strict=True)]  # type: ignore[arg-type]
    if failed:
        return (span.kind, told, "not tested: it fails, or needs the size of a message, which is not recorded")
    added = np.array([math.nan if answer is None else answer for answer in answers])
    otherwise = (met.reason == DROPPED_BY_OWN) != np.isnan(added)
    if not any(o.kind in ("delay", *MASKS) or o.kind in GATES for o in beside):
        otherwise |= np.abs(met.delay - added) > INSTANT
    return (span.kind, told, f"otherwise for {otherwise.sum()}", len(met.seq), float(not otherwise.any()))
