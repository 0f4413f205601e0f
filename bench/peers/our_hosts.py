"""Our side with many agents: several in each process in lock-step, a process each in wall-clock time, all in one."""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from msgspec.structs import replace

from agents.agent_config import AgentConfig
from bench.peers.failure import checked
from bench.peers.our_scale import grown
from bench.scale import AGENT_SECONDS
from plant.plant_config import PlantConfig
from scenarios.drivers.outcome import Outcome
from scenarios.drivers.process_driver import run_processes
from scenarios.results.record import Recorder

T_C = 0.1
"""Control period (s) that is asked for with many agents."""

SHORTEST = 4
"""Least simulated time (s) of a run in one process."""

RATES = (
    "read_s",
    "build_s",
    "plant_per_s",
    "agents_per_s",
    "of_real_time",
    "by_the_clock",
    "us_per_message",
    "memory_MB",
)
"""Columns of `bench.scale` that are kept."""


def hosted(agents: int, processes: int, ticks: int) -> dict[str, float]:
    """Measure agents on a ring that share processes, in lock-step: time (s) of a tick and of a simulated second."""
    plant, configured = grown(agents, "ring", ticks, T_C)
    outcome = _run(plant, configured, shared=processes)
    tick = outcome.run_s / outcome.ticks
    return {
        f"ours.hosted.{agents}.tick": tick,
        f"ours.hosted.{agents}.per_second": tick / T_C,
        f"ours.hosted.{agents}.start": outcome.start_s,
    }


def in_time(agents: int, ticks: int) -> dict[str, float]:
    """Measure a process for each agent on a ring in wall-clock time: steps in time (%), and how late the others were.

    The driver of wall-clock time has a link for each pair of neighbours, and nobody waits for anybody.
    """
    plant, configured = grown(agents, "ring", ticks, T_C)
    wall = replace(plant, clock="wall")
    outcome = _run(wall, tuple(replace(agent, clock="wall") for agent in configured), gaps=True)
    pacing = outcome.pacing
    if pacing is None or not pacing.steps:
        raise RuntimeError(f"{agents} agents in wall-clock time: the plant told no pacing")
    return {
        f"ours.wall.{agents}.in_time": 100.0 * (1.0 - pacing.late / pacing.steps),
        f"ours.wall.{agents}.late_p95": pacing.p95,
        f"ours.wall.{agents}.late_worst": pacing.worst,
        f"ours.wall.{agents}.start": outcome.start_s,
    }


def simulated_second(agents: int, T_c: float) -> dict[str, float]:
    """Measure agents on a ring in one process, a new one: what a simulated second costs (`bench.scale`)."""
    end = max(SHORTEST, round(AGENT_SECONDS / agents))
    words = ["--only", f"{agents}", "--T_c", f"{T_c:g}", "--end", f"{end}", "--rounds", "1", "--graphs", "ring"]
    (row,) = json.loads(checked([sys.executable, "-m", "bench.scale", *words]))
    return {f"scale.{round(1e3 * T_c)}.{agents}.{name}": row[name] for name in RATES}


def _run(plant: PlantConfig, agents: Iterable[AgentConfig], *, shared: int = 0, gaps: bool = False) -> Outcome:
    assert plant.end is not None
    with tempfile.TemporaryDirectory(prefix="gp-hosts-") as name:
        folder = Path(name)
        with Recorder(folder / "case", gaps=gaps) as recorder:
            outcome = run_processes(plant, agents, folder / "log", recorder, shared=shared)
            if outcome.broke:
                raise RuntimeError(outcome.broke)
            recorder.finish(plant.end, plant.record_step)
    return outcome
