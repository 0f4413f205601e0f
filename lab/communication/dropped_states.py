"""States of which a receiver's journal has the number alone: how many it dropped, and when these were sent."""

from __future__ import annotations

from typing import NamedTuple

from gridpeers.wire.journal import RejectedCount
from gridpeers.wire.messages import Journal

ON_WAY = 1.0
"""Longest time (s of wall time) that a state is on its way, as the check of the account has it by default."""

OF_SENDER = ("excess", "stale")
"""Kinds of rejection that a sender's own sound states may have, and of which a journal may have the number alone."""


class DroppedStates(NamedTuple):
    """States that a receiver dropped; a stranger's messages on the same key are among them, as nobody has read them."""

    number: int
    """Their number."""
    since: float
    """Run time (s) at which they were sent, at the earliest."""
    until: float
    """Run time (s) at which they were sent, at the latest."""


class DropTimes:
    """When what a part of a journal says of dropped states happened: after the part before it was sent.

    Parameters
    ----------
    t_end : float
        End of the record (s of run time): no part is believed to be later.
    speed : float
        Run time that passes in a second.

    Examples
    --------
    >>> times, count = DropTimes(9.0, 1.0), RejectedCount(1004.5, "state/inv1", "excess", 7)
    >>> for t in (4.25, 4.5):
    ...     times.note(Journal(sender="inv2", epoch=1, seq=0, t=t, data=b""))
    >>> times.of("inv2", count)
    DroppedStates(number=7, since=3.25, until=5.5)
    """

    def __init__(self, t_end: float, speed: float) -> None:
        self._t_end, self._way = t_end, ON_WAY * max(1.0, speed)
        self._parts: dict[str, tuple[int, float, float]] = {}
        """Epoch of each sender's last part, its run time (s), and that of the last one before that time."""

    def note(self, journal: Journal) -> None:
        """Note that a part of a journal comes."""
        t = min(journal.t, self._t_end)
        epoch, last, earlier = self._parts.get(journal.sender, (journal.epoch, t, t))
        if epoch != journal.epoch:
            last = earlier = t
        if t > last:
            last, earlier = t, last
        self._parts[journal.sender] = journal.epoch, last, earlier

    def of(self, receiver: str, count: RejectedCount) -> DroppedStates:
        """Return what an entry of the last part of a receiver's journal says."""
        _, last, earlier = self._parts[receiver]
        return DroppedStates(count.count, earlier - self._way, last + self._way)
