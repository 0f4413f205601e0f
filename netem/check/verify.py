"""Tests of all links of a run, and a warning for each deviation that chance does not explain."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from netem.check.fault_checks import (
    AS_IT_SAYS,
    Finding,
    added_by,
    check_delay,
    check_gate,
    check_loss,
    check_own,
    check_share,
)
from netem.check.sent_messages import sent_messages
from netem.draws import Stream
from netem.fault_schedule import GATES
from netem.ledger import LinkTrace
from netem.schema.fault import Span
from netem.schema.pattern import Link
from wire.plugins.plugin import Plugin

LEVEL = 0.001
"""Probability that a run without any fault of ours has a warning, over all its tests together (Holm)."""

MASKS = {
    "rate": "a rate",
    "slots": "slots",
    "cut": "a cut that holds",
    "partition": "a partition that holds",
    "flap": "a flap that holds",
}
"""Faults that add to a delay, so that its law cannot be seen alone."""


class LinkTest(NamedTuple):
    """One test of one link."""

    src: str
    """Sender."""
    dst: str
    """Receiver."""
    what: str
    """Name of the test, e.g. "loss" or "bursts"."""
    configured: str
    """Value of the entry."""
    realised: str
    """Value in the run; why nothing was tested, if nothing was."""
    n: int
    """Number of messages, bursts or copies."""
    p: float | None = None
    """Probability that chance alone is as far off; 0 or 1 where nothing is left to chance, None if not tested."""
    ok: bool | None = None
    """Whether that is plausible among all tests of the run; None if nothing was tested."""


class Report(NamedTuple):
    """The result of all tests."""

    rows: tuple[LinkTest, ...]
    """Every test, by link."""
    warnings: tuple[str, ...]
    """One sentence for each that failed."""


def verify(
    traces: Iterable[LinkTrace],
    spans: Mapping[Link, Sequence[Span]],
    seed: int,
) -> Report:
    """Compare links in a run with their configuration.

    Parameters
    ----------
    traces : Iterable[LinkTrace]
        Verdicts of all receivers, as they were taken.
    spans : Mapping[Link, Sequence[Span]]
        Faults of each link, without overlaps: `Netem.spans`, or after live changes `FaultSchedule.flat`.
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
    """Return a sentence on a test that failed."""
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
    """Return the tests of one entry of one link."""
    if span.kind in ("rate", "slots"):
        return []
    sent = sent_messages(traces, span)
    own = [other for other in others if isinstance(other.model, Plugin) and _overlap(other, span)]
    if isinstance(span.model, Plugin):
        if beside := [other.kind for other in own if other is not span]:
            return [(span.kind, AS_IT_SAYS, f"not tested: {' and '.join(beside)} on it", len(sent.seq), None)]
        alone = not any(other.kind in ("delay", *MASKS) and _overlap(other, span) for other in others)
        return [check_own(sent, span, link, seed, alone=alone)]
    if span.kind == "loss":
        return check_loss(sent, span.model)
    if span.kind in GATES:
        return [check_gate(sent, span)]
    arrived = sent.arrived()
    if span.kind == "duplicate":
        return [check_share("duplicate", int((arrived.copies - 1).sum()), len(arrived.seq), span.model.p)]
    if span.kind == "corrupt":
        return [check_share("corrupt", int(arrived.flipped.sum()), int(arrived.copies.sum()), span.model.p)]
    masks = [MASKS.get(other.kind, other.kind) for other in others if _masks(other, span)]
    masks += ["fifo"] if span.model.fifo else []
    if len(own) == 1 and masks == [own[0].kind]:  # what it added is known, and taken away
        added, why = added_by(sent, own[0], link, seed)
        sent = sent._replace(delay=sent.delay - added)
        masks = masks if why else []
    if masks:
        return [("delay", str(span.model.__struct_config__.tag), f"not tested: {' and '.join(masks)} on it", 0, None)]
    return check_delay(sent, span.model, Stream(seed, *link, "delay"))


def _masks(other: Span, span: Span) -> bool:
    """Return whether another entry adds to the delays of this one."""
    own = isinstance(other.model, Plugin)
    if (other.kind not in MASKS and not own) or not _overlap(other, span):
        return False
    return own or other.kind not in GATES or other.model.hold


def _overlap(one: Span, other: Span) -> bool:
    """Return whether two entries hold at the same time."""
    return one.from_s < other.to_s and other.from_s < one.to_s


def _holm(rows: Sequence[LinkTest]) -> list[LinkTest]:
    """Mark the tests that fail, where any may fail by chance with probability `LEVEL`."""
    tested = sorted((i for i, row in enumerate(rows) if row.p is not None), key=lambda i: rows[i].p or 0.0)
    judged = list(rows)
    failing = True
    for rank, i in enumerate(tested):
        p = rows[i].p
        assert p is not None
        failing = failing and p <= LEVEL / (len(tested) - rank)
        judged[i] = rows[i]._replace(ok=not failing)
    return judged
