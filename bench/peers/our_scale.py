"""Our side at other sizes: agents on feeders grown of copies of ours, as processes and in one process."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from msgspec.structs import replace

import gridpeers as gp
from agents.agent_config import AgentConfig
from bench.harness import GRIDPEERS
from bench.peers.failure import checked
from bench.scale import timed_run
from plant.build import build_plant
from plant.plant_config import PlantConfig
from scenarios.drivers.process_driver import run_processes
from scenarios.results.record import Recorder
from scenarios.schema.configs import configs

INVERTERS = 9
"""Of one copy."""

ISLANDING = 0.2
"""Time (s) of the islanding, from which on the law acts."""

T_C = 0.02
"""Control period (s)."""


def links(graph: str, agents: int) -> int:
    """Return the messages of a tick between agents, and from and to the plant.

    Examples
    --------
    >>> links("full", 9), links("ring", 9)
    (90, 36)
    """
    return (agents * (agents - 1) if graph == "full" else 2 * agents) + 2 * agents


@cache
def grown(agents: int, graph: str, ticks: int, T_c: float = T_C) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """Return the configurations of a run of so many ticks with so many agents, on as many copies as they need.

    Inverters beyond the number of agents stay on droop.
    """
    copies = -(-agents // INVERTERS)
    with _folder() as folder:
        words = ["microgrid123", "--copies", str(copies), "--joint", "450", "--switch", "13-152", "--T-c", str(T_c)]
        out = folder / f"{agents}-{graph}"
        checked([*GRIDPEERS, "feeder", "grow", *words, "--out", str(out)])
        scenario = gp.load(out / "islanding.toml")
        (event,) = scenario.tables["event"]
        scenario = scenario.replace(
            {
                "event": [event | {"t_s": ISLANDING}],
                "time.end_s": round(ISLANDING + ticks * T_c, 9),
                "case.ring.graph": graph,
            }
        )
        plant, configured = configs(scenario.spec, scenario.feeder, "ring")
    chosen = configured[:agents]
    return replace(plant, agents=tuple(agent.name for agent in chosen)), chosen


def with_processes(agents: int, graph: str, ticks: int) -> dict[str, float]:
    """Measure a tick (s) with a process for each agent."""
    plant, configured = grown(agents, graph, ticks)
    assert plant.end is not None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with Recorder(folder / "case") as recorder:
            outcome = run_processes(plant, configured, folder / "log", recorder)
            if outcome.broke:
                raise RuntimeError(outcome.broke)
            recorder.finish(plant.end, plant.record_step)
    return {f"ours.{graph}.{agents}": outcome.run_s / outcome.ticks, f"ours.start.{graph}.{agents}": outcome.start_s}


def in_process(agents: int, graph: str, ticks: int) -> dict[str, float]:
    """Measure a tick in one process, processor time (s): the whole, and per message without the plant."""
    plant, configured = grown(agents, graph, ticks)
    assert plant.end is not None
    built = build_plant(plant)
    with tempfile.TemporaryDirectory(prefix="gp-links-") as name:
        times = timed_run(plant, configured, built, Path(name) / "case")
    count = round(plant.end / plant.T_c)
    return {
        f"inprocess.tick.{graph}.{agents}": (times["plant_s"] + times["agents_s"]) / count,
        f"inprocess.link.{graph}.{agents}": times["agents_s"] / count / links(graph, agents),
    }


@contextmanager
def _folder() -> Iterator[Path]:
    """Give a folder that lasts as long as the bench: the plant reads its tables when it is built."""
    _kept.append(tempfile.TemporaryDirectory(prefix="gp-scale-"))
    yield Path(_kept[-1].name)


_kept: list[tempfile.TemporaryDirectory[str]] = []
