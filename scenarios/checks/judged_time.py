"""The limit `since_s` of checks: the run time from which on they judge."""

from __future__ import annotations

from typing import Annotated

from scenarios.checks.check_verdict import NotJudgedError
from scenarios.results.history import History
from wire.schema.plausible import Plausible, Unit

Since = Annotated[float, Unit("s"), Plausible("a time of the run", 0.0, 86_400.0)]
"""Run time (s) from which on a check judges: events open windows, the ends of faults of links and agents open none."""


def require_time(history: History, since_s: float) -> None:
    """Raise NotJudgedError if a run ends before a check begins to judge: it would pass unjudged."""
    end = float(history.t[-1])
    if since_s > end:
        raise NotJudgedError(f"the run ends at {end:g} s, before since_s = {since_s:g} s")
