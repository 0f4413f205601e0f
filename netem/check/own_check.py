"""A fault of somebody's own: asked again about each message that met it, it must say what it said in the run.

Its law is known to its author alone, but its numbers are looked up by message: so what it does can be repeated. A fault
that depends on something else, which no other driver would repeat, is found by this too.
"""

from __future__ import annotations

import math
from typing import NoReturn

import numpy as np

from netem.check.loss_check import Finding
from netem.check.rows import UNSEEN, Array, Messages
from netem.draws import Stream
from netem.models import INSTANT
from netem.models.own_fault import DROPPED_BY_OWN, judge_of
from netem.schema.fault import Span
from netem.schema.pattern import Link

AS_IT_SAYS = "as its judge says"
"""What such a fault is configured to do."""


class _Size:
    """Size of a message, which is not recorded: a fault that looks at it fails, and so is not tested."""

    def _refuse(self, *of: object) -> NoReturn:
        raise LookupError

    __bool__ = __eq__ = __float__ = __hash__ = __index__ = _refuse


def added_by(sent: Messages, span: Span, link: Link, seed: int) -> tuple[Array, str]:
    """Return the delay (s) that a fault adds to each message, NaN where it drops it; and why it cannot be asked, or "".

    To messages that never met it, because a cut or loss dropped them or it did not hold, it adds nothing.
    """
    failed: list[str] = []
    judge, size = judge_of(span.model, *link, Stream(seed, *link, span.kind), failed.append), _Size()
    met = ~np.isin(sent.reason, [*UNSEEN, "loss"]) & ~np.isinf(sent.delay)
    met &= (sent.t + INSTANT >= span.from_s) & (sent.t + INSTANT < span.to_s)
    added = np.zeros(len(sent.seq))
    for i in np.flatnonzero(met).tolist():
        delay = judge(int(sent.seq[i]), float(sent.t[i]), size)  # type: ignore[arg-type]
        added[i] = math.nan if delay is None else delay
    return added, "it fails, or looks at the size of a message, which is not recorded" if failed else ""


def check_own(sent: Messages, span: Span, link: Link, seed: int, *, alone: bool) -> Finding:
    """Compare what a fault did with what it says now: which messages it drops and, where it is alone, their delays."""
    met = sent.those(~np.isin(sent.reason, [*UNSEEN, "loss"]) & ~np.isinf(sent.delay))
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
