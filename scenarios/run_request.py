"""A request for a run: scenario, folder and options."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from gridpeers.scenarios.results.metrics_file import RunMetrics

Driver = Literal["processes", "inprocess"]
"""Driver of a case: one process per agent over Zenoh, or all in this process."""

Progress = Callable[[str, float, float], None]
"""Takes the case, the time it has reached (s) and its end (s)."""


class BrokenRunError(RuntimeError):
    """The run could not be finished; the folder says so too."""


class LawStopError(BrokenRunError):
    """A law failed, and the scenario says `on_law_failure = "stop"`."""


@dataclass(frozen=True, kw_only=True)
class Request(RunMetrics):
    """A run with its options; its folder is empty. Wall-clock time needs the driver "processes"."""

    driver: Driver
    keys: str | Path | None = None
    """Folder with the certificates of plant and agents; None: links are open, on the loopback."""
    processes: int = 0
    """Number of processes that agents share; 0 gives each agent its own. It decides no number."""
    strict: bool = False
    """Wall-clock: whether the run breaks when the plant cannot keep pace."""
    outside: tuple[str, ...] | None = None
    """Inverters that federates of a HELICS federation control instead of our agents; None for a run without HELICS."""
    lasting: bool = True
    """Whether the folder stays: one that goes with the results of a notebook has no figures, and is not named."""
