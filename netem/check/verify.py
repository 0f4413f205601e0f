"""All links of a run, all that can be tested, and a warning for what chance does not explain."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import stats

from netem.check.delay_check import check_delay
from netem.check.loss_check import FEWEST, Finding, check_loss
from netem.check.own_check import AS_IT_SAYS, added_by, check_own
from netem.check.rows import LinkTest, Messages, messages
from netem.draws import Stream
from netem.fault_schedule import GATES
from netem.ledger import LinkTrace
from netem.schema.fault import Span
from netem.schema.pattern import Link
from wire.plugin import Plugin

LEVEL = 0.001
"""Probability that a run without any fault of ours has a warning, over all its tests together (Holm)."""

MASKS = {
    "rate": "a rate",
    "slots": "slots",
    "cut": "a cut that holds",
    "partition": "a partition that holds",
    "flap": "a flap that holds",
}
"""What adds to a delay, so that its law cannot be seen alone."""


class Report(NamedTuple):
    """What was found."""

    rows: tuple[LinkTest, ...]
    """Every test, by link."""
    warnings: tuple[str, ...]
    """One sentence for each that failed."""


def verify(
    traces: Iterable[LinkTrace],
    spans: Mapping[Link, Sequence[Span]],
    seed: int,
) -> Report:
    """Compare what links did with what is configured.

    Parameters
    ----------
    traces : Iterable[LinkTrace]
        Verdicts of all receivers, as they were taken.
    spans : Mapping[Link, Sequence[Span]]
        What is configured for each link, without overlaps: `Netem.spans`, or after live changes `FaultSchedule.flat`.
    seed : int
        Seed of the run.

    References
    ----------
    Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Statist. 6 (1979) 65-70.
    """
    by_link: dict[Link, list[LinkTrace]] = {}
    for trace in traces:
        by_link.setdefault(Link(trace.src, trace.dst), []).append(trace)
    rows = [
        LinkTest(link.src, link.dst, *finding)
        for link in sorted(spans)
        for span in spans[link]
        for finding in _findings(tuple(by_link.get(link, ())), span, spans[link], link, seed)
    ]
    judged = _holm(rows)
    return Report(tuple(judged), tuple(_warning(row) for row in judged if row.ok is False))


def _warning(row: LinkTest) -> str:
    """Say what a test that failed means."""
    if row.configured == AS_IT_SAYS:
        return (
            f"{row.src} -> {row.dst}: {row.what}, asked again, says {row.realised} messages: judge may depend on the "
            "message and the draws alone, else no run can be repeated"
        )
    return (
        f"{row.src} -> {row.dst}: {row.what} is {row.realised}, configured {row.configured} "
        f"(n = {row.n}, p = {row.p:.2g}); this is not chance, so netem or this check is wrong: please report it"
    )


def _findings(
    traces: tuple[LinkTrace, ...], span: Span, others: Sequence[Span], link: Link, seed: int
) -> list[Finding]:
    """Tests of one entry of one link."""
    if span.kind in ("rate", "slots"):
        return []
    sent = messages(traces, span)
    own = [other for other in others if isinstance(other.model, Plugin) and _overlap(other, span)]
    if isinstance(span.model, Plugin):
        if beside := [other.kind for other in own if other is not span]:
            return [(span.kind, AS_IT_SAYS, f"not tested: {' and '.join(beside)} on it", len(sent.seq), None)]
        alone = not any(other.kind in ("delay", *MASKS) and _overlap(other, span) for other in others)
        return [check_own(sent, span, link, seed, alone=alone)]
    if span.kind == "loss":
        return check_loss(sent, span.model)
    if span.kind in GATES:
        return [_gate(sent, span)]
    arrived = sent.those(np.isfinite(sent.delay))
    if span.kind == "duplicate":
        return [_share("duplicate", int((arrived.copies - 1).sum()), len(arrived.seq), span.model.p)]
    if span.kind == "corrupt":
        return [_share("corrupt", int(arrived.flipped.sum()), int(arrived.copies.sum()), span.model.p)]
    masks = [MASKS.get(other.kind, other.kind) for other in others if _masks(other, span)]
    masks += ["fifo"] if span.model.fifo else []
    if len(own) == 1 and masks == [own[0].kind]:  # what it added is known, and taken away
        added, why = added_by(sent, own[0], link, seed)
        sent = sent._replace(delay=sent.delay - added)
        masks = [] if not why else masks
    if masks:
        return [("delay", str(span.model.__struct_config__.tag), f"not tested: {' and '.join(masks)} on it", 0, None)]
    return check_delay(sent, span.model, Stream(seed, *link, "delay"))


def _masks(other: Span, span: Span) -> bool:
    """Whether another entry adds to the delays of this one."""
    own = isinstance(other.model, Plugin)
    if (other.kind not in MASKS and not own) or not _overlap(other, span):
        return False
    return own or other.kind not in GATES or other.model.hold


def _overlap(one: Span, other: Span) -> bool:
    """Whether two entries hold at the same time."""
    return one.from_s < other.to_s and other.from_s < one.to_s


def _share(what: str, found: int, n: int, p: float) -> Finding:
    if n < FEWEST:
        return (what, f"{p:.4g}", f"too few messages to tell: {n}", n, None)
    return (what, f"{p:.4g}", f"{found / n:.4g}", n, float(stats.binomtest(found, n, p).pvalue))


def _gate(sent: Messages, span: Span) -> Finding:
    """A cut lets nothing through; of one that holds, or of a flap, only what is dropped without need is wrong."""
    n = len(sent.seq)
    if span.kind == "flap" or span.model.hold:
        return (
            span.kind,
            "held" if span.model.hold else "up and down",
            "not tested: it depends on the time alone",
            n,
            None,
        )
    through = int((sent.reason == "").sum())
    return (span.kind, "nothing passes", f"{through} passed", n, float(through == 0) if n else None)


def _holm(rows: Sequence[LinkTest]) -> list[LinkTest]:
    """Which tests fail when all together may fail by chance with probability `LEVEL`."""
    tested = sorted((i for i, row in enumerate(rows) if row.p is not None), key=lambda i: rows[i].p or 0.0)
    judged = list(rows)
    failing = True
    for rank, i in enumerate(tested):
        p = rows[i].p
        assert p is not None
        failing = failing and p <= LEVEL / (len(tested) - rank)
        judged[i] = rows[i]._replace(ok=not failing)
    return judged
