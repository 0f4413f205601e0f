"""Check of loading: no inverter is loaded beyond its rating for long."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np

from gridpeers.scenarios.checks.check_verdict import Check, Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.checks.judged_time import Since, require_longer, require_time
from gridpeers.scenarios.results.history import Flags
from gridpeers.wire.schema.plausible import Plausible, Unit

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
        """Yield the longest overload of each inverter that is too long."""
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
