"""Checks of rest: at the end of a window values stand still; after the last event no oscillation lasts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np

from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Since, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase, IslandWindow
from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.scenarios.results.steadiness import FEWEST, STEADY, Ends, ends_of
from gridpeers.wire.schema.plausible import Plausible, Unit

_RATE = Plausible("a rate", 1e-6, 100.0, above_zero=True)


class SteadyEnd(Check):
    """At the end of each window, frequency, power and voltage of every inverter stand still: they can be measured."""

    f_Hz_per_s: Annotated[float, Unit("Hz/s"), _RATE] = 0.05
    """Fastest change of a grid-forming inverter's frequency (Hz/s) between the means of the last two parts of 0.2 s:
    that of `docs/results.md`, as the next two."""
    P_pu_per_s: Annotated[float, Unit("pu/s"), _RATE] = 0.05
    """Fastest change of real power (pu of rating per s)."""
    V_pu_per_s: Annotated[float, Unit("pu/s"), _RATE] = 0.005
    """Fastest change of the terminal voltage (pu of nominal per s)."""
    after_s: Annotated[float, Unit("s"), Plausible("a settling time", 0.0, 3600.0)] = 2.0
    """Shortest time (s) from the event to the end of a window that is judged."""
    since_s: Since = 0.0
    """Run time (s) from which on it is judged: the end of the last fault of links or agents, say."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        if not case.windows:
            raise NotJudgedError("the run has no event")
        judged = False
        for part in case.parts:
            history, plates = part.history, part.nameplates
            ends = ends_of(history.t, part.window.start, part.window.end)
            late = case.rows_from(part, self.after_s, self.since_s)
            settled = (ends.last | ends.before).any() and late[ends.steady].all()
            if not settled or min(ends.last.sum(), ends.before.sum()) < FEWEST:
                continue
            judged = True
            there: Flags = np.all(history.present[ends.last | ends.before], axis=0)
            yield from _fastest(part, ends, history.f, there & plates.GFM, "f", "Hz/s", self.f_Hz_per_s)
            yield from _fastest(part, ends, history.P / plates.s, there, "P", "pu/s", self.P_pu_per_s)
            yield from _fastest(part, ends, history.V / plates.V_nom, there, "V", "pu/s", self.V_pu_per_s)
        if not judged:
            raise NotJudgedError(f"no event has a window of more than {self.after_s:g} s")


def _fastest(
    part: IslandWindow, ends: Ends, x: Floats, which: Flags, name: str, unit: str, limit: float
) -> Iterator[Violation]:
    """Yield the inverter that moves fastest, if it moves too fast to be measured."""
    if not which.any():
        return
    rate = np.where(which, (x[ends.last].mean(axis=0) - x[ends.before].mean(axis=0)) / ends.apart, 0.0)
    i = int(np.abs(rate).argmax())
    if abs(rate[i]) > limit * (1.0 + 1e-9):
        yield Violation(
            text=f"{name} still moves in the last {STEADY:g} s of {part.label}",
            t=part.window.end,
            agent=part.history.inverters[i],
            value=float(rate[i]),
            unit=unit,
            limit=limit,
        )


RANK = 1e-3  # Part of the largest singular value below which a singular value is noise, or of no account
MOST = 16  # Most exponentials: eight oscillations, or fewer with a mean and a drift


class Mode(NamedTuple):
    f: float
    damping: float
    """Damping ratio: 0 lasts for ever, 1 does not swing, negative grows."""
    swing: float
    """Highest minus lowest value at the end of the signal, in its unit."""


def modes(x: Floats, dt: float) -> list[Mode]:
    r"""Return the oscillations in a signal sampled every dt (s), the largest at its end first.

    .. math:: x_k = \sum_m r_m z_m^k, \qquad s_m = \ln(z_m) / \Delta t, \qquad \zeta_m = -\Re(s_m) / |s_m|

    Examples
    --------
    >>> t = np.arange(100) * 0.02
    >>> (mode,) = modes(60.0 + 0.5 * np.exp(-0.3 * t) * np.cos(2 * np.pi * 1.5 * t), 0.02)
    >>> round(mode.f, 3), round(mode.damping, 3), round(mode.swing, 2)
    (1.5, 0.032, 0.55)
    """
    y = x - x.mean()
    count = len(y)
    if count < 8 or not np.ptp(y) > 0.0:
        return []
    length = count // 3
    hankel = np.lib.stride_tricks.sliding_window_view(y, length + 1)
    _, sizes, rows = np.linalg.svd(hankel, full_matrices=False)
    rank = min(int((sizes > RANK * sizes[0]).sum()), MOST, length)
    basis = rows[:rank].T
    z = np.linalg.eigvals(np.linalg.pinv(basis[:-1]) @ basis[1:])
    z = z[(np.abs(z) > 1e-6) & (np.abs(z) < 2.0)]
    powers = z[None, :] ** np.arange(count)[:, None]
    r = np.linalg.lstsq(powers, y.astype(complex), rcond=None)[0]
    found = []
    for pole, residue in zip(z, r, strict=True):
        s = np.log(pole) / dt
        if s.imag > 0.0:  # of each pair of conjugates, one
            size = np.abs(residue) * np.abs(pole) ** (count - 1)
            swing = (4.0 if np.abs(pole.imag) > 1e-9 * np.abs(pole) else 2.0) * float(size)  # at half the rate no pair
            found.append(Mode(f=float(s.imag / (2.0 * np.pi)), damping=float(-s.real / np.abs(s)), swing=swing))
    return sorted(found, key=lambda mode: -mode.swing)


_FEWEST_ROWS = 30  # Rows without which nothing is said

_SAMPLES = 150
"""Samples of a signal in which modes are sought: more rows are averaged, for slow modes, or cut off, for fast ones."""

_SWING = Plausible("a swing", 1e-6, 10.0, above_zero=True)


class _Signal(NamedTuple):
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
        t = case.history.t
        since = max((case.disturbed_at(window) for window in case.windows), default=float(t[0]))
        tail = t >= max(float(t[-1]) - self.tail_s, 0.5 * (since + float(t[-1]))) - 1e-9
        if tail.sum() < _FEWEST_ROWS:
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
    last = x[-max(_FEWEST_ROWS // 2, len(x) // 2) :]
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
