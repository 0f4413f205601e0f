"""Timer of an agent's ticks within the plant's control period. Pure.

An agent has a clock of its own. The worst time to tick is just as its next measurement comes, now before it and now
after: its set-points then miss the plant's step, so that its loop is one
period longer. With the paper's gains the vars of a returning inverter then ring for a second. So an agent keeps to the
middle half of the period between two measurements, as an inverter's controller keeps clear of its own sampling.
"""

from __future__ import annotations

from gridpeers.wire.timing import Timer

EARLIEST, LATEST = 0.25, 0.75

CONVINCED = 5
"""Measurements in a row that come at a bad time before the ticks are moved: one may just have been late."""


class TickTimer:
    """Due times of an agent's ticks; unless it `keeps_clear` of the measurements, they drift as the own clock does."""

    def __init__(self, period: float, *, keeps_clear: bool = True) -> None:
        self.period = period
        self._keeps_clear = keeps_clear
        self.start(0.0)

    def start(self, now: float) -> None:
        """Begin anew, with a tick at once; the first measurement is believed."""
        self._timer = Timer(self.period, now)
        self._measured: float | None = None
        self._astride = CONVINCED - 1

    @property
    def due(self) -> float:
        return self._timer.due

    def measured(self, at: float) -> None:
        self._measured = at

    def take(self, now: float) -> int:
        skipped = self._timer.take(now)
        if self._measured is None or not self._keeps_clear:
            return skipped
        phase = (self._timer.due - self._measured) / self.period % 1.0
        self._measured = None
        self._astride = 0 if EARLIEST <= phase <= LATEST else self._astride + 1
        if self._astride >= CONVINCED:
            self._astride = 0
            self._timer.shift((0.5 - phase) * self.period)
        return skipped
