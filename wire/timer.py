"""A drift-free schedule: due times are start + n period, whatever happened in between. Time is an argument (s)."""

from __future__ import annotations


class Timer:
    """Due times of something that is done once in a period.

    Parameters
    ----------
    period : float
        Distance of the due times (s of wall time).
    now : float
        The first due time (s).

    Examples
    --------
    Woken too late, it skips what cannot be made up for, and keeps its schedule:

    >>> timer = Timer(0.5, now=10.0)
    >>> timer.take(10.0), timer.due
    (0, 10.5)
    >>> timer.take(11.75), timer.due
    (2, 12.0)
    """

    def __init__(self, period: float, now: float) -> None:
        self.period = period
        self._start = now
        self._n = 0

    @property
    def due(self) -> float:
        """Next due time (s)."""
        return self._start + self._n * self.period

    def take(self, now: float) -> int:
        """Note that the due thing is done now; number of due times that were skipped for it."""
        past = max(0, int((now - self.due) / self.period))
        self._n += past + 1
        return past

    def shift(self, by: float) -> None:
        """Put all due times to come later by so much (s), or earlier."""
        self._start += by
