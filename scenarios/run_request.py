"""A run as it is asked for, and as its driver ends it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from gridpeers.plant.equipment import Tables
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.wire.messages import Journal, LinkReport, LinkRequest, Pacing, PlantEvent

if TYPE_CHECKING:
    from gridpeers.scenarios.results.plots.style import Format


@dataclass(frozen=True, kw_only=True)
class Outcome:
    broke: str
    """With the last log lines of the process that broke it; "" if the run reached its end."""
    reproducible: bool
    """False once something unscripted (a dead agent) has entered the run."""
    events: tuple[PlantEvent, ...]
    notes: tuple[str, ...]
    """Notes for a person though the run went on: processes that died, messages that were dropped."""
    ticks: int
    start_s: float
    """Time (s) until the first row."""
    run_s: float
    """Time (s) from the first row to the end."""
    pacing: Pacing | None = None


SPEEDS = (0.1, 50.0)  # Least and greatest useful speed (s of run time per s), of a live run or of a scenario


Other = LinkReport | Journal | LinkRequest
"""Messages that a driver gives its recorder beside telemetry, if the configurations ask for them."""

Driver = Literal["processes", "inprocess"]
"""Driver of a case: one process per agent over Zenoh, or all in this process."""

Clock = Literal["simulated", "realtime"]  # Lock-step of plant and agents, or real time

Progress = Callable[[str, float, float], None]  # Takes the case, the time it has reached (s) and its end (s)


class BrokenRunError(RuntimeError):
    """The run could not be finished; the folder says so too."""


class LawStopError(BrokenRunError):
    """A law failed, and the scenario says `on_law_failure = "stop"`."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """A run with its options; its folder is empty at the start. Real time needs the driver "processes", or "live"."""

    scenario: ScenarioModel
    """Checked; with the seed and the cases asked for."""
    feeder: Tables
    driver: Driver | Literal["live"]
    """Live: a run that people start by hand."""
    folder: Path
    clock: Clock = "simulated"
    speed: float = 1.0
    """Real time: run time (s) per s."""
    keys: str | Path | None = None
    """Folder with the certificates of plant and agents; None: links are open, on the loopback."""
    processes: int = 0
    """Number of processes that agents share; 0 gives each agent its own. It decides no number."""
    strict: bool = False
    """Real time: the run breaks when the plant cannot keep pace."""
    figures: Format = "png"
    lasting: bool = True
    """The folder stays; one that goes with the results of a notebook has no figures, and is not named."""
