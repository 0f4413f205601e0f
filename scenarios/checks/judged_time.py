"""The time of a run that a check judges: from `since_s` on, and long enough for its limits."""

from __future__ import annotations

from typing import Annotated

from gridpeers.scenarios.checks.check_verdict import NotJudgedError
from gridpeers.scenarios.results.history import History
from gridpeers.wire.schema.plausible import Plausible, Unit

Since = Annotated[float, Unit("s"), Plausible("a time of the run", 0.0, 86_400.0)]
"""Run time (s) from which on a check judges: events open windows, the ends of faults of links and agents open none."""


def require_time(history: History, since_s: float) -> None:
    """Raise NotJudgedError if a run ends before a check begins to judge: it would pass unjudged."""
    end = float(history.t[-1])
    if since_s > end:
        raise NotJudgedError(f"the run ends at {end:g} s, before since_s = {since_s:g} s")


def require_longer(judged_s: float, limit: str, limit_s: float) -> None:
    """Raise NotJudgedError if nothing in a run is long enough to break a limit of time: it would pass unjudged.

    Parameters
    ----------
    judged_s : float
        Time of the run that a check judges (s).
    limit : str
        Name of the limit.
    limit_s : float
        The limit (s).
    """
    if judged_s <= limit_s + 1e-9:
        raise NotJudgedError(
            f"the run is shorter than needed: it has {judged_s:g} s to judge, and {limit} = {limit_s:g} s"
        )
