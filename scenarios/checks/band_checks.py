"""Checks of bands and ratings: f and V return to their bands, and no inverter is loaded beyond its rating for long."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np

from gridpeers.scenarios.checks.check_verdict import (
    Check,
    NotJudgedError,
    Since,
    Violation,
    require_longer,
    require_time,
)
from gridpeers.scenarios.checks.checked_case import CheckedCase, IslandWindow
from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.wire.schema.plausible import Plausible, Unit
from gridpeers.wire.schema.table_schema import Below

_SETTLING = Plausible("a settling time", 0.0, 3600.0)


class Frequency(Check):
    """Each grid-forming inverter is within a band of nominal frequency some time after each event, and stays there."""

    band_Hz: Annotated[float, Unit("Hz"), Plausible("a band of frequency", 1e-4, 10.0, above_zero=True)] = 0.01
    """Largest abs(f - f_nom) (Hz): what the paper calls restored."""
    within_s: Annotated[float, Unit("s"), _SETTLING] = 2.0
    """Time (s) after the event from which on it holds."""
    since_s: Since = 0.0
    """Run time (s) from which on it is judged: the end of the last fault of links or agents, say."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        for part in _parts(case, self.within_s, self.since_s):
            rows, history, plates = case.rows_from(part, self.within_s, self.since_s), part.history, part.nameplates
            error = np.abs(history.f - case.f_nom)
            forming = history.present & plates.GFM
            yield from _worst(
                part, rows, error, ~(error <= self.band_Hz) & forming, f"abs(f - {case.f_nom:g}), {part.label}", "Hz",
                self.band_Hz,
            )  # fmt: skip
            dark = rows & ~forming.any(axis=1)
            if not part.fed and dark.any():
                yield Violation(
                    text=f"no grid-forming inverter is on the network, {part.label}",
                    t=float(history.t[dark][0]),
                    agent=history.inverters[0],
                )


class Voltage(Check):
    """The terminal voltage of each inverter is within a band some time after each event, and stays there."""

    low_pu: Annotated[float, Unit("pu"), Plausible("a least voltage", 0.3, 1.2), Below("high_pu")] = 0.88
    """Least voltage (pu of nominal): the end of continuous operation of IEEE 1547-2018."""
    high_pu: Annotated[float, Unit("pu"), Plausible("a greatest voltage", 0.8, 1.5)] = 1.10
    """Greatest voltage (pu of nominal), of the same."""
    within_s: Annotated[float, Unit("s"), _SETTLING] = 2.0
    """Time (s) after the event from which on it holds: the clearing time of OV1 of IEEE 1547-2018."""
    since_s: Since = 0.0
    """Run time (s) from which on it is judged: the end of the last fault of links or agents, say."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        for part in _parts(case, self.within_s, self.since_s):
            rows, history = case.rows_from(part, self.within_s, self.since_s), part.history
            V = history.V / part.nameplates.V_nom
            low, high = (self.low_pu > V) & history.present, ~(self.high_pu >= V) & history.present
            yield from _worst(part, rows, V, high, f"V, {part.label}", "pu", self.high_pu)
            yield from _worst(part, rows, V, low, f"V, {part.label}", "pu", self.low_pu, least=True)


def _parts(case: CheckedCase, within_s: float, since_s: float) -> list[IslandWindow]:
    """Return the islands of the windows that last long enough; raise NotJudgedError if there are none."""
    if not case.windows:
        raise NotJudgedError("the run has no event")
    parts = [part for part in case.parts if case.rows_from(part, within_s, since_s).any()]
    if not parts:
        raise NotJudgedError(f"no event has a window of more than {within_s:g} s")
    return parts


def _worst(
    part: IslandWindow, rows: Flags, x: Floats, out: Flags, text: str, unit: str, limit: float, *, least: bool = False
) -> Iterator[Violation]:
    """Yield the row of each column that is farthest out of a limit."""
    for i, name in enumerate(part.history.inverters):
        at = np.flatnonzero(rows & out[:, i])
        if at.size:
            worst = at[(x[at, i].argmin if least else x[at, i].argmax)()]
            yield Violation(
                text=text, t=float(part.history.t[worst]), agent=name, value=float(x[worst, i]), unit=unit, limit=limit
            )


_LOADING = Plausible("a limit of loading", 0.1, 10.0, above_zero=True)


class Rating(Check):
    """No inverter delivers more real or apparent power than it is made for, but for a while."""

    P_limit_pu: Annotated[float, Unit("pu"), _LOADING] = 1.05
    """Largest real power (pu of the rating) that may last; the margin is for ripple."""
    S_limit_pu: Annotated[float, Unit("pu"), _LOADING] = 1.2
    """Largest apparent power (pu of the rating) that may last: S_max of the grid-following inverters."""
    longest_s: Annotated[float, Unit("s"), Plausible("a time of overload", 0.0, 3600.0)] = 1.0
    """Longest time (s) above one of them."""
    since_s: Since = 0.0
    """Run time (s) from which on it is judged: the end of the last fault of links or agents, say."""

    with_killed: bool = True
    """Whether inverters count whose agents the scenario has killed: they stay at their last set-points."""

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
                    yield Violation(
                        text=f"{name} above {limit:g} pu of the rating, up to {peak:.3g} pu",
                        t=float(history.t[first]),
                        agent=inverter,
                        value=lasted,
                        unit="s",
                        limit=self.longest_s,
                    )


def longest_stretch(holds: Flags) -> tuple[int, int]:
    """Return first and last row of the longest stretch in which something holds; (0, -1) if it never does.

    Examples
    --------
    >>> longest_stretch(np.array([True, False, True, True, False])), longest_stretch(np.array([False]))
    ((2, 3), (0, -1))
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], holds, [False]]).astype(int)))
    starts, ends = edges[::2], edges[1::2] - 1
    if not starts.size:
        return 0, -1
    longest = int((ends - starts).argmax())
    return int(starts[longest]), int(ends[longest])
