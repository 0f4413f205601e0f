"""The outcome of a run, by any driver."""

from __future__ import annotations

from dataclasses import dataclass

from gridpeers.wire.messages import Pacing, PlantEvent


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a run. Its rows went to the callback as they came."""

    broke: str
    """Why the run broke, with the last log lines of the process that broke it; "" if it reached its end."""
    reproducible: bool
    """False once something unscripted (a dead agent) has entered the run."""
    events: tuple[PlantEvent, ...]
    """All events of the plant and of the roster."""
    notes: tuple[str, ...]
    """Notes for a person though the run went on: processes that died, messages that were dropped."""
    ticks: int
    """Last tick that was reported."""
    start_s: float
    """Wall time (s) until the first row."""
    run_s: float
    """Wall time (s) from the first row to the end."""
    pacing: Pacing | None = None
    """How well the plant kept real time; only in wall-clock time."""
