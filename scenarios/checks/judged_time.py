"""The limit `since_s` of checks: the run time from which on they judge."""

from __future__ import annotations

from typing import Annotated

from wire.schema.plausible import Plausible, Unit

Since = Annotated[float, Unit("s"), Plausible("a time of the run", 0.0, 86_400.0)]
"""Run time (s) from which on a check judges: events open windows, the ends of faults of links and agents open none."""
