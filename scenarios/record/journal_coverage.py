"""Of which run times the journal of a node is there, where parts of it are lost. Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

from gridpeers.wire.messages import Journal

Hole = tuple[float, float]
"""Run times (s) between which something is lost: the first one excluded, the last one included."""

INSTANT = 1e-6
"""Run time (s) far below any control period."""


class JournalCoverage:
    """Follow the parts of one journal by their numbers, and find where some are lost.

    Parts of a periodic one come all the time, as of an agent with emulated links. Of another, one comes with each
    change, and says nothing about the time since the one before.

    Examples
    --------
    >>> coverage = JournalCoverage(periodic=True)
    >>> for number, t in ((0, 0.2), (1, 0.4), (3, 0.8)):
    ...     part = Journal(sender="inv1", epoch=1, seq=number, t=t, data=b"")
    ...     coverage.take(part, lambda t=t: (t - 0.18, t))
    >>> [(since, round(until, 3)) for since, until in coverage.holes(())]
    [(0.4, 0.62)]
    """

    def __init__(self, *, periodic: bool) -> None:
        self._periodic = periodic
        self._epoch = self._number = -1
        self._t = -1.0
        """Run time of the last part (s)."""
        self._span: Callable[[], Hole | None] = _nothing
        self._since: float | None = None
        """Since when (s) parts are lost, as far as none has come that tells how it went on."""
        self._gaps: list[Hole] = []

    @property
    def known_until(self) -> float:
        """Run time (s) behind which nothing is known: parts of a run that goes on, or was killed, are still missing."""
        return self._t if self._periodic else inf

    def take(self, journal: Journal, span: Callable[[], Hole | None]) -> None:
        """Take the next part; `span`, asked beside a lost part, gives the run times (s) of which it tells all."""
        restarted = journal.epoch != self._epoch
        if not restarted and journal.seq <= self._number:
            return  # published again
        whole = journal.seq == (0 if restarted else self._number + 1)
        unfinished = restarted and self._periodic and self._epoch >= 0  # the last part of a killed process is missing
        if (not whole or unfinished) and self._since is None:
            before = self._span()
            self._since = self._t if before is None else before[1]
        self._epoch, self._number, self._t, self._span = journal.epoch, journal.seq, max(self._t, journal.t), span
        if self._since is not None and (known := span()) is not None:
            self._gaps.append((self._since, known[0] - INSTANT))
            self._since = None

    def holes(self, damaged: Sequence[Hole], *, numbered: bool = True) -> list[Hole]:
        """Return where parts are lost, by their numbers or by the run times (s) of damaged chunks of the file.

        Not numbered are records of one process of earlier versions, which counted the parts of all agents together.
        """
        if not damaged and not numbered:
            return []
        since = self._since
        behind = [begin for begin, end in damaged if end >= self._t]
        if since is None and behind:  # no part came after it, which would tell by its number what is lost
            since = self._t if self._periodic else max(self._t, min(behind) - INSTANT)
        return self._gaps if since is None else [*self._gaps, (since, inf)]


def _nothing() -> None:
    """Tell of nothing: no part has come."""


def inside(holes: Sequence[Hole], t: float) -> bool:
    return any(since < t <= until for since, until in holes)
