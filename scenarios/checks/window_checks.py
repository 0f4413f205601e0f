"""Checks of each island in the window of each event: f and V in their bands, equal sharing, and steady values."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated

import numpy as np

from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Since, Violation, WithKilled
from gridpeers.scenarios.checks.checked_case import CheckedCase, IslandWindow
from gridpeers.scenarios.results.history import Flags, Floats
from gridpeers.scenarios.results.metric import label
from gridpeers.scenarios.results.metrics import FEWEST, ends_of, measure
from gridpeers.scenarios.results.sharing_index import sharing_index
from gridpeers.wire.schema.table_schema import Below, Plausible, Unit

_SETTLING = Plausible("a settling time", 0.0, 3600.0)
_After = Annotated[
    float, Unit("s"), _SETTLING, "Shortest time (s) from the event to the end of a window that is judged."
]


def _each_island(
    case: CheckedCase,
    delay_s: float,
    since_s: float,
    judge: Callable[[IslandWindow, Flags], list[Violation] | None],
    unjudged: str = "no event has a window of more than {:g} s",
) -> Iterator[Violation]:
    """Judge the islands of all windows, each with its rows from `delay_s` after the event on; None: not judged."""
    if not case.windows:
        raise NotJudgedError("the run has no event")
    judged = 0
    for part in (part for parts in case.parts.values() for part in parts if part.history.t.size):
        found = judge(part, case.rows_from(part, delay_s, since_s))
        if found is not None:
            judged += 1
            yield from found
    if not judged:
        raise NotJudgedError(unjudged.format(delay_s))


def _worst(
    part: IslandWindow, x: Floats, out: Flags, name: str, unit: str, limit: float, *, least: bool = False
) -> list[Violation]:
    """Return the row of each column that is farthest out of a limit."""
    found = []
    for i in range(len(part.history.inverters)):
        rows = np.flatnonzero(out[:, i])
        if rows.size:
            row = rows[x[rows, i].argmin() if least else x[rows, i].argmax()]
            found.append(part.violation(f"{name}, {part.label}", i, x[row, i], limit, unit, part.history.t[row]))
    return found


class Frequency(Check):
    """Each grid-forming inverter is within a band of nominal frequency some time after each event, and stays there."""

    since_s: Since = 0.0
    band_Hz: Annotated[float, Unit("Hz"), Plausible("a band of frequency", 1e-4, 10.0, above_zero=True)] = 0.01
    """Largest abs(f - f_nom) (Hz); below it, the paper calls the frequency restored."""
    within_s: Annotated[float, Unit("s"), _SETTLING] = 2.0
    """Time (s) after the event from which the band applies."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        def judge(part: IslandWindow, late: Flags) -> list[Violation] | None:
            history, error = part.history, np.abs(part.history.f - case.f_nom)
            forming = history.present & part.nameplates.GFM
            out = ~(error <= self.band_Hz) & forming & late[:, None]
            found = _worst(part, error, out, f"abs(f - {case.f_nom:g})", "Hz", self.band_Hz)
            dark = late & ~forming.any(axis=1)
            if not part.fed and dark.any():
                text = f"no grid-forming inverter is on the network, {part.label}"
                found.append(Violation(text=text, t=float(history.t[dark][0]), agent=history.inverters[0]))
            return found if late.any() else None

        return _each_island(case, self.within_s, self.since_s, judge)


class Voltage(Check):
    """The terminal voltage of each inverter is within a band some time after each event, and stays there."""

    since_s: Since = 0.0
    low_pu: Annotated[float, Unit("pu"), Plausible("a least voltage", 0.3, 1.2), Below("high_pu")] = 0.88
    """Lowest voltage (pu of nominal) of continuous operation by IEEE 1547-2018."""
    high_pu: Annotated[float, Unit("pu"), Plausible("a greatest voltage", 0.8, 1.5)] = 1.10
    """Highest voltage (pu of nominal) of continuous operation."""
    within_s: Annotated[float, Unit("s"), _SETTLING] = 2.0
    """Time (s) after the event from which the band applies; the clearing time of OV1 of IEEE 1547-2018."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        def judge(part: IslandWindow, late: Flags) -> list[Violation] | None:
            V, judged = part.history.V / part.nameplates.V_nom, part.history.present & late[:, None]
            high = _worst(part, V, ~(self.high_pu >= V) & judged, "V", "pu", self.high_pu)
            low = _worst(part, V, (self.low_pu > V) & judged, "V", "pu", self.low_pu, least=True)
            return high + low if late.any() else None

        return _each_island(case, self.within_s, self.since_s, judge)


class PowerSharing(Check):
    """At the end of each window, the inverters of an island deliver equal real power per unit of their ratings."""

    since_s: Since = 0.0
    after_s: _After = 2.0
    with_killed: WithKilled = True
    limit: Annotated[float, Plausible("a sharing index", 1e-4, 2.0, above_zero=True)] = 0.01
    """Largest MPSI, (16); below it, the paper calls power shared."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        return _unequal(self, case, "MPSI")


class VarSharing(Check):
    """At the end of each window, the inverters of an island deliver equal vars per unit of their ratings."""

    since_s: Since = 0.0
    after_s: _After = 2.0
    with_killed: WithKilled = True
    limit: Annotated[float, Plausible("a sharing index", 1e-4, 2.0, above_zero=True)] = 0.2
    """Largest MQSI, (17): a fifth of the value of uncoordinated islanding, as in the paper."""

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        return _unequal(self, case, "MQSI")


def _unequal(check: PowerSharing | VarSharing, case: CheckedCase, index: str) -> Iterator[Violation]:
    def judge(part: IslandWindow, late: Flags) -> list[Violation] | None:
        history, plates = part.history, part.nameplates
        end = late & ends_of(history.t, part.window.start, part.window.end).steady
        shares = history.present & plates.shares & ~case.at_limit(part)
        shares = (shares if check.with_killed else shares & ~case.killed(history))[end]
        if part.fed or not end.any() or not (shares.sum(axis=1) >= 2).all():
            return None
        power, m = (history.P, plates.m_p) if index == "MPSI" else (history.Q, plates.m_q)
        x, s = power[end], plates.s
        found = float(np.mean(sharing_index(x, s, m, shares)))
        if np.isnan(found):
            return None
        equal = np.where(shares, x, 0.0).sum() / np.where(shares, s / m, 0.0).sum()
        far = int(np.abs(np.where(shares, m * x / s - equal, 0.0)).sum(axis=0).argmax())
        return [part.violation(f"{index}, {part.label}", far, found, check.limit)] if found > check.limit else []

    nothing = "no island of two inverters shares anything {:g} s after an event"
    return _each_island(case, check.after_s, check.since_s, judge, nothing)


class SteadyEnd(Check):
    """At the end of each window, frequency, powers and voltages are steady.

    A value is steady where the report prints it as a number (`docs/reference/measures-and-checks.md`).
    """

    since_s: Since = 0.0
    after_s: _After = 2.0

    def __call__(self, case: CheckedCase) -> Iterator[Violation]:
        def judge(part: IslandWindow, late: Flags) -> list[Violation] | None:
            ends = ends_of(part.history.t, part.window.start, part.window.end)
            if not late[ends.steady].all() or min(ends.last.sum(), ends.before.sum()) < FEWEST:
                return None
            found = measure(part.history, part.nameplates, part.window, case.f_nom).reasons
            reasons = {label(name, case.f_nom): found.get(name, "") for name in ("f_error_Hz", "p", "V_error")}
            return [
                Violation(text=f"{name} {reason}, {part.label}", t=part.window.end)
                for name, reason in reasons.items()
                if reason.startswith("not steady")
            ]

        return _each_island(case, self.after_s, self.since_s, judge)
