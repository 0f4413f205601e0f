"""What one link did while one entry held: its messages, in columns."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from netem.fault_schedule import GATES
from netem.ledger import LinkTrace, Outcome
from netem.models import INSTANT
from netem.schema.fault import Span

Array = npt.NDArray[np.float64]

UNSEEN = GATES
"""Reasons of those that never met loss, rate or delay."""


class LinkTest(NamedTuple):
    """One test of one link."""

    src: str
    """Who sent."""
    dst: str
    """Who received."""
    what: str
    """What was tested, e.g. "loss" or "bursts"."""
    configured: str
    """What the entry says."""
    realised: str
    """What was found; why nothing was tested, if nothing was."""
    n: int
    """Of how many messages, bursts or copies."""
    p: float | None = None
    """Probability that chance alone is as far off; 0 or 1 where nothing is left to chance, None if not tested."""
    ok: bool | None = None
    """Whether that is plausible among all tests of the run; None if nothing was tested."""


class Messages(NamedTuple):
    """Messages of a link in a time, each once, in the order of their numbers."""

    seq: npt.NDArray[np.int64]
    """Their numbers."""
    t: Array
    """When they were sent (s of run time)."""
    reason: npt.NDArray[np.str_]
    """Why they were dropped, empty if they were not."""
    delay: npt.NDArray[np.float64]
    """Delay of the first copy (s), NaN of the dropped."""
    copies: npt.NDArray[np.int64]
    """How many copies were on their way."""
    flipped: npt.NDArray[np.int64]
    """How many of them had a flipped bit."""

    def those(self, chosen: npt.NDArray[np.bool_]) -> Messages:
        """Some of them."""
        return Messages(
            self.seq[chosen],
            self.t[chosen],
            self.reason[chosen],
            self.delay[chosen],
            self.copies[chosen],
            self.flipped[chosen],
        )


def messages(traces: tuple[LinkTrace, ...], span: Span) -> Messages:
    """Messages sent while an entry held; of one that was judged twice, the last verdict."""
    last: dict[int, Outcome] = {}
    when: dict[int, float] = {}
    for trace in traces:
        for seq, t, outcome in zip(trace.seq, trace.t, trace.outcome, strict=True):
            if span.from_s <= t + INSTANT < span.to_s:
                last[seq], when[seq] = outcome, t
    rows = [_columns(last[seq]) for seq in sorted(last)]
    reason, delay, copies, flipped = zip(*rows, strict=True) if rows else ((), (), (), ())
    return Messages(
        np.array(sorted(last), dtype=np.int64),
        np.array([when[seq] for seq in sorted(last)], dtype=np.float64),
        np.array(reason, dtype=np.str_),
        np.array(delay, dtype=np.float64),
        np.array(copies, dtype=np.int64),
        np.array(flipped, dtype=np.int64),
    )


def _columns(outcome: Outcome) -> tuple[str, float, int, int]:
    if isinstance(outcome, str):
        return outcome, math.nan, 0, 0
    if isinstance(outcome, (int, float)):
        return "", float(outcome), 1, 0
    return "", float(outcome[0][0]), len(outcome), sum(bit is not None for _, bit in outcome)
