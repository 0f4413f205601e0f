"""Due times of steps in real time, and the delays behind them. Times are arguments: s on the driver's clock."""

from __future__ import annotations

from collections import deque

from gridpeers.wire.messages import Pacing

TOLERATED = 0.01  # part of the steps that may be more than one control period late
HOPELESS = 10  # control periods behind which the schedule is put off: a rush is not real time either
FIRST = 100  # steps before which nothing is judged
_KEPT = 5_000  # delays that are remembered, the latest, for the percentiles of a run that stays


class RealTimePacer:
    """Due times of the plant's steps from `now` (s) on, and the delays behind them."""

    def __init__(self, period: float, now: float) -> None:
        self.period = period
        self.steps = self.late = 0
        self._start = now
        self._delays: deque[float] = deque(maxlen=_KEPT)
        self._worst = self._slipped = 0.0
        self._failed = False

    @property
    def due(self) -> float:
        return self._start + self._slipped + self.steps * self.period

    def note(self, now: float) -> float:
        """Note that the due step is made now; return the time (s) by which the schedule is put off for it."""
        delay = max(0.0, now - self.due)
        self.steps += 1
        self.late += delay > self.period
        self._delays.append(delay)
        self._worst = max(self._worst, delay)
        if delay <= HOPELESS * self.period:
            return 0.0
        self._slipped += delay
        return delay

    def take_failure(self, of: int | None) -> bool:
        """Return whether it is clear now, and was not before, that the plant cannot keep pace.

        `of`: steps of the whole run, of which `TOLERATED` may be late; without an end those made so far count.
        """
        judged = of is not None or self.steps >= FIRST
        fails = judged and self.late > TOLERATED * (self.steps if of is None else of)
        news, self._failed = fails and not self._failed, self._failed or fails
        return news

    def report(self) -> Pacing:
        ordered = sorted(self._delays) or [0.0]

        def percentile(part: float) -> float:
            return ordered[min(len(ordered) - 1, int(part * len(ordered)))]

        return Pacing(
            steps=self.steps,
            late=self.late,
            p50=percentile(0.5),
            p95=percentile(0.95),
            p99=percentile(0.99),
            worst=self._worst,
            slipped=self._slipped,
        )


def sentence(pacing: Pacing, period: float) -> str:
    share = 100.0 * pacing.late / max(1, pacing.steps)
    ms = 1e3
    text = (
        f"{pacing.late} of {pacing.steps} steps ({share:.1f} %) more than a control period ({period * ms:g} ms) late; "
        f"delay p50 {pacing.p50 * ms:.1f}, p95 {pacing.p95 * ms:.1f}, p99 {pacing.p99 * ms:.1f}, "
        f"worst {pacing.worst * ms:.1f} ms"
    )
    return text + (f"; all delays together put the schedule {pacing.slipped:.2f} s back" if pacing.slipped else "")
