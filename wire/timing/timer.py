"""A drift-free schedule: due times are always start + n period. Time is an argument (s)."""

from __future__ import annotations


class Timer:
    """Due times of a periodic task.

    Parameters
    ----------
    period : float
        Distance of the due times (s of wall time).
    now : float
        The first due time (s).

    Examples
    --------
    When it wakes too late, it skips the past due times and keeps its schedule:

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
        """Note that the task is done now (s); return the number of skipped due times."""
        past = max(0, int((now - self.due) / self.period))
        self._n += past + 1
        return past

    def shift(self, by: float) -> None:
        """Move all further due times by so much (s)."""
        self._start += by
