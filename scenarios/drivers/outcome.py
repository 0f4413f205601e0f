"""How a run ended, whichever driver ran it."""

from __future__ import annotations

from dataclasses import dataclass

from wire.messages import Pacing, PlantEvent


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a run ended. Rows went to the callback as they came."""

    broke: str
    """Why the run broke, with the last log lines of who broke it; empty if it reached its end."""
    reproducible: bool
    """False once something unscripted (a dead agent) has entered the run."""
    events: tuple[PlantEvent, ...]
    """Everything that happened in the plant and to the roster."""
    notes: tuple[str, ...]
    """What a person should be told though the run went on: who died, what was dropped."""
    ticks: int
    """Last tick that was reported."""
    start_s: float
    """Wall time (s) until the first row."""
    run_s: float
    """Wall time (s) from the first row to the end."""
    pacing: Pacing | None = None
    """How well the plant kept real time; only in wall-clock time."""
