"""Check of steadiness: what is measured at the end of a window stands still there."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np

from gridpeers.scenarios.checks.check_verdict import Check, NotJudgedError, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase, IslandWindow
from gridpeers.scenarios.checks.judged_time import Since
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
        """Yield the fastest inverter of each quantity and window."""
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
