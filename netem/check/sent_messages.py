"""The messages of one link while one entry held, in columns."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netem.fault_schedule import GATES
from netem.ledger import LinkTrace, Outcome, copies_of
from netem.models import INSTANT
from netem.schema.fault import Span

Array = npt.NDArray[np.float64]


class SentMessages(NamedTuple):
    """Messages of a link in a time, each once, in the order of their numbers."""

    seq: npt.NDArray[np.int64]
    """Their numbers."""
    t: Array
    """When they were sent (s of run time)."""
    reason: npt.NDArray[np.str_]
    """Why they were dropped, empty if they were not."""
    delay: Array
    """Delay of the first copy (s), NaN of the dropped."""
    copies: npt.NDArray[np.int64]
    """How many copies were on their way."""
    flipped: npt.NDArray[np.int64]
    """How many of them had a flipped bit."""

    def those(self, chosen: npt.NDArray[np.bool_]) -> SentMessages:
        """Return some of them."""
        return SentMessages._make(column[chosen] for column in self)

    def past_gates(self) -> SentMessages:
        """Return those that no cut, partition or flap dropped or keeps for ever; they met loss."""
        return self.those(~np.isin(self.reason, GATES) & ~np.isinf(self.delay))

    def arrived(self) -> SentMessages:
        """Return those that were not dropped."""
        return self.those(np.isfinite(self.delay))


def sent_messages(traces: tuple[LinkTrace, ...], span: Span) -> SentMessages:
    """Return the messages sent while an entry held; of one that was judged twice, the last verdict."""
    last: dict[int, tuple[float, Outcome]] = {}
    for trace in traces:
        for seq, t, outcome in zip(trace.seq, trace.t, trace.outcome, strict=True):
            if span.from_s <= t + INSTANT < span.to_s:
                last[seq] = t, outcome
    rows = [(seq, t, *_columns(outcome)) for seq, (t, outcome) in sorted(last.items())]
    columns = zip(*rows, strict=True) if rows else [()] * 6
    kinds = (np.int64, np.float64, np.str_, np.float64, np.int64, np.int64)
    return SentMessages._make(np.array(column, dtype=kind) for column, kind in zip(columns, kinds, strict=True))


def _columns(outcome: Outcome) -> tuple[str, float, int, int]:
    """Return why a message was dropped, its delay (s), its copies, and those with a flipped bit."""
    if isinstance(outcome, str):
        return outcome, math.nan, 0, 0
    copies = copies_of(outcome)
    return "", float(copies[0][0]), len(copies), sum(bit is not None for _, bit in copies)
