"""Checks of a whole run: loading, oscillations, laws that fail, and inverters that trip."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np

from gridpeers.scenarios.checks.check_verdict import (
    Check,
    NotJudgedError,
    Since,
    Violation,
    WithKilled,
    require_longer,
    require_time,
)
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.scenarios.results.recorded_events import law_failures, tripped_by, tripped_inverters
from gridpeers.wire.schema.table_schema import Plausible, Unit

_LOADING = Plausible("a limit of loading", 0.1, 10.0, above_zero=True)
_SWING = Plausible("a swing", 1e-6, 10.0, above_zero=True)


class LawFailed(Check):
    """No law and no graph of a user fails in an agent, which would leave its inverter on primary droop."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        failures = law_failures(case.events)
        if not failures and case.scenario.cases[case.case].secondary == "none":
            raise NotJudgedError("no inverter runs a law")
        for failure in failures:
            yield Violation(text=failure.why, t=failure.t, agent=failure.agent)


class Returned(Check):
    """At the end of the run, every inverter that has tripped is in service again, unless its agent had it leave.

    A run must be long enough for that: an inverter returns `protection.enter_service_s` after voltage and frequency at
    its terminals have become normal. After three trips without a minute in service between it stays off.
    """

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        trips = Counter(name for event in case.events for name in tripped_by(event))
        if not trips:
            raise NotJudgedError("no inverter tripped")
        off = tripped_inverters(case.events)
        for name in sorted(off.keys() & set(case.history.inverters), key=lambda name: (off[name].t, name)):
            text, t = f"not back in service, {off[name].text}", off[name].t
            yield Violation(text=text, t=t, agent=name, value=trips[name], unit="trips")


class Rating(Check):
    """No inverter delivers more real or apparent power than its limits for long."""

    P_limit_pu: Annotated[float, Unit("pu"), _LOADING] = 1.05
    """Largest real power (pu of the rating) that may last; the margin is for ripple."""
    S_limit_pu: Annotated[float, Unit("pu"), _LOADING] = 1.2
    """Largest apparent power (pu of the rating) that may last: S_max of the grid-following inverters."""
    longest_s: Annotated[float, Unit("s"), Plausible("a time of overload", 0.0, 3600.0)] = 1.0
    """Longest time (s) above a limit."""
    since_s: Since = 0.0
    with_killed: WithKilled = True

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        history, s = case.history, case.nameplates.s
        require_time(history, self.since_s)
        require_longer(float(history.t[-1] - max(history.t[0], self.since_s)), "longest_s", self.longest_s)
        judged: Flags = (history.t >= self.since_s - 1e-9)[:, None] & (self.with_killed | ~case.killed(history))
        P, S = np.abs(history.P) / s, np.hypot(history.P, history.Q) / s
        for name, loading, limit in (("P", P, self.P_limit_pu), ("S", S, self.S_limit_pu)):
            for i, inverter in enumerate(history.inverters):
                first, last = longest_stretch(~(loading[:, i] <= limit) & judged[:, i])
                lasted = float(history.t[last] - history.t[first]) if last >= first else 0.0
                if lasted > self.longest_s + 1e-9:
                    peak = loading[first : last + 1, i].max()
                    text = f"{name} above {limit:g} pu of the rating, up to {peak:.3g} pu"
                    t, most = float(history.t[first]), self.longest_s
                    yield Violation(text=text, t=t, agent=inverter, value=lasted, unit="s", limit=most)


def longest_stretch(holds: Flags) -> tuple[int, int]:
    """Return first and last row of the longest stretch in which something holds; (0, -1) if it never does."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    starts, ends = edges[::2], edges[1::2] - 1
    if not starts.size:
        return 0, -1
    longest = int((ends - starts).argmax())
    return int(starts[longest]), int(ends[longest])


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


class Oscillation(Check):
    """After the last event, no oscillation of an inverter's frequency, power or voltage lasts.

    The dominant mode is estimated from the recorded rows by the matrix pencil method: an oscillation is one that still
    swings at the end by more than a ripple, and is damped by less than usual practice in power systems asks for.
    """

    damping_percent: Annotated[float, Unit("%"), Plausible("a damping ratio", 0.0, 100.0)] = 3.0
    """Least damping ratio of the dominant mode (%); system operators commonly accept no less."""
    f_swing_Hz: Annotated[float, Unit("Hz"), _SWING] = 0.01
    """Largest swing of a grid-forming inverter's frequency (Hz, highest minus lowest) that counts as ripple."""
    P_swing_pu: Annotated[float, Unit("pu"), _SWING] = 0.01
    """Largest swing of real power (pu of rating) that counts as ripple."""
    V_swing_pu: Annotated[float, Unit("pu"), _SWING] = 0.005
    """Largest swing of the terminal voltage (pu of nominal) that counts as ripple."""
    tail_s: Annotated[float, Unit("s"), Plausible("the length of a tail", 0.2, 3600.0, above_zero=True)] = 4.0
    """Longest judged part of the end of the run (s), at most half of the time since the last event."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        history, plates, t = case.history, case.nameplates, case.history.t
        since = max((case.disturbed_at(window) for window in case.windows), default=float(t[0]))
        tail = t >= max(float(t[-1]) - self.tail_s, 0.5 * (since + float(t[-1]))) - 1e-9
        if tail.sum() < _FEWEST_ROWS:
            raise NotJudgedError(f"{int(tail.sum())} rows in the second half of the time since the last event")
        step, there = float(np.diff(t[tail]).mean()), np.all(history.present[tail], axis=0)
        for name, x, which, limit, unit in (
            ("f", history.f, there & plates.GFM, self.f_swing_Hz, "Hz"),
            ("P", history.P / plates.s, there, self.P_swing_pu, "pu"),
            ("V", history.V / plates.V_nom, there, self.V_swing_pu, "pu"),
        ):
            i = _swings_most(x[tail], which, limit)
            if i is None:
                continue
            for y, dt in _looks(x[tail, i], step):
                mode = next((one for one in modes(y, dt) if one.f * len(y) * dt >= 1.0), None)  # it has a whole period
                if mode and mode.damping < self.damping_percent / 100.0 and mode.swing > limit:
                    text = f"{name} swings by {mode.swing:.2g} {unit} at {mode.f:.2g} Hz, damping"
                    percent, least, agent = 100.0 * mode.damping, self.damping_percent, history.inverters[i]
                    yield Violation(text=text, t=float(t[-1]), agent=agent, value=percent, unit="%", limit=least)
                    break


def _swings_most(x: Floats, which: Flags, limit: float) -> int | None:
    """Return the column that swings most in the last half, without its drift; None if none does by the limit."""
    last = x[-max(_FEWEST_ROWS // 2, len(x) // 2) :]
    k = np.arange(len(last)) - 0.5 * (len(last) - 1)
    drift = (k @ (last - last.mean(axis=0))) / (k @ k)  # what settles slowly moves, and does not swing
    size = np.where(which, np.ptp(last - np.outer(k, drift), axis=0), 0.0)
    return int(size.argmax()) if size.max() > limit else None


def _looks(x: Floats, step: float) -> Iterator[tuple[Floats, float]]:
    """Yield a signal with few enough samples: all of it, averaged, and its end, at full rate."""
    blocks = -(-len(x) // _SAMPLES)
    if blocks > 1:
        cut = x[len(x) % blocks :]
        yield cut.reshape(-1, blocks).mean(axis=1), blocks * step
    yield x[-_SAMPLES:], step
