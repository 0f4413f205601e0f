"""Check of oscillation: after the last event no swing of frequency, power or voltage lasts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np

from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.checks.physics.matrix_pencil import Mode, modes
from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.wire.schema.plausible import Plausible, Unit

FEWEST = 30
"""Rows without which nothing is said."""

_SAMPLES = 150
"""Samples of a signal in which modes are sought: more rows are averaged, for slow modes, or cut off, for fast ones."""

_SWING = Plausible("a swing", 1e-6, 10.0, above_zero=True)


class _Signal(NamedTuple):
    """One quantity of one inverter over the tail."""

    name: str
    agent: str
    unit: str
    x: Floats
    size: float
    """Swing of the last half, in parts of the largest that passes."""
    limit: float


class Oscillation(Check):
    """After the last event, no oscillation of an inverter's frequency, power or voltage lasts.

    The dominant mode is estimated from the recorded rows by the matrix pencil method: an oscillation is one that still
    swings at the end by more than a ripple, and is damped by less than usual practice in power systems asks for.
    """

    damping_percent: Annotated[float, Unit("%"), Plausible("a damping ratio", 0.0, 100.0)] = 3.0
    """Least damping ratio of the dominant mode (%): what system operators take for the least acceptable."""
    f_swing_Hz: Annotated[float, Unit("Hz"), _SWING] = 0.01
    """Swing of a grid-forming inverter's frequency (Hz, highest minus lowest) that is no ripple any more."""
    P_swing_pu: Annotated[float, Unit("pu"), _SWING] = 0.01
    """The same of real power (pu of rating)."""
    V_swing_pu: Annotated[float, Unit("pu"), _SWING] = 0.005
    """The same of the terminal voltage (pu of nominal)."""
    tail_s: Annotated[float, Unit("s"), Plausible("the length of a tail", 0.2, 3600.0, above_zero=True)] = 4.0
    """Longest tail of the run that is looked at (s); at most the second half of the time since the last event."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        """Yield, of each quantity, the inverter whose dominant mode lasts."""
        t = case.history.t
        since = max((case.disturbed_at(window) for window in case.windows), default=float(t[0]))
        tail = t >= max(float(t[-1]) - self.tail_s, 0.5 * (since + float(t[-1]))) - 1e-9
        if tail.sum() < FEWEST:
            raise NotJudgedError(f"{int(tail.sum())} rows in the second half of the time since the last event")
        step = float(np.diff(t[tail]).mean())
        for signal in self._largest(case, tail):
            for x, dt in _looks(signal.x, step):
                mode = _dominant(x, dt)
                if mode and mode.damping < self.damping_percent / 100.0 and mode.swing > signal.limit:
                    yield Violation(
                        text=f"{signal.name} swings by {mode.swing:.2g} {signal.unit} at {mode.f:.2g} Hz, damping",
                        t=float(t[-1]),
                        agent=signal.agent,
                        value=100.0 * mode.damping,
                        unit="%",
                        limit=self.damping_percent,
                    )
                    break

    def _largest(self, case: CheckedCase, tail: Flags) -> Iterator[_Signal]:
        """Yield of each quantity the signal that swings most, if it swings by more than a ripple."""
        history, plates = case.history, case.nameplates
        there: Flags = np.all(history.present[tail], axis=0)
        forming = there & plates.GFM
        yield from _swinging("f", "Hz", history.f[tail], forming, history.inverters, self.f_swing_Hz)
        yield from _swinging("P", "pu", history.P[tail] / plates.s, there, history.inverters, self.P_swing_pu)
        yield from _swinging("V", "pu", history.V[tail] / plates.V_nom, there, history.inverters, self.V_swing_pu)


def _swinging(
    name: str, unit: str, x: Floats, which: Flags, inverters: tuple[str, ...], limit: float
) -> Iterator[_Signal]:
    if not which.any():
        return
    last = x[-max(FEWEST // 2, len(x) // 2) :]
    k = np.arange(len(last)) - 0.5 * (len(last) - 1)
    drift = (k @ (last - last.mean(axis=0))) / (k @ k)  # what settles slowly moves, and does not swing
    size = np.where(which, np.ptp(last - np.outer(k, drift), axis=0) / limit, 0.0)
    worst = int(size.argmax())
    if size[worst] > 1.0:
        yield _Signal(name, inverters[worst], unit, x[:, worst], float(size[worst]), limit)


def _looks(x: Floats, step: float) -> Iterator[tuple[Floats, float]]:
    """Yield a signal with few enough samples: all of it, averaged, and its end, at full rate."""
    blocks = -(-len(x) // _SAMPLES)
    if blocks > 1:
        cut = x[len(x) % blocks :]
        yield cut.reshape(-1, blocks).mean(axis=1), blocks * step
    yield x[-_SAMPLES:], step


def _dominant(x: Floats, dt: float) -> Mode | None:
    """Return the mode that swings most at the end, among those that had a period to show."""
    seen = [mode for mode in modes(x, dt) if mode.f * len(x) * dt >= 1.0]
    return seen[0] if seen else None
