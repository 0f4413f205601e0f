"""Cost of agents in one process against their number: joined copies of a feeder, islanded as one, on a ring.

    python -m bench.peers.our_scale AGENTS T_C END

One run, in a process of its own, so that its memory is its own; it prints one line of JSON. Times are of the processor,
as seconds a simulated second, split at the plant's interface; of real time by the clock too, as the plant may use all
cores. A message is one from an agent to a neighbour, or from or to the plant.
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch

from msgspec.structs import replace

import bench.harness  # noqa: F401  # one thread, before numpy is imported
import gridpeers as gp
from gridpeers.plant.build import build_plant
from gridpeers.plant.feeder import Plant
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.record import Recorder
from gridpeers.scenarios.schema.configs import configs

ISLAND, SUBSTATION, JOINT = 9, "150", "450"
"""Inverters of the feeder `microgrid123`, its substation, and its bus at which copies are joined."""

TABLES = ("buses", "lines", "switches", "loads", "capacitors", "regulators", "transformers", "inverters")
NAMES = ("name", "alias", "microgrid", "zone", "bus", "from_bus", "to_bus")


def of_copy(row: Any, k: int) -> Any:
    """Return a row of the feeder in copy k, with names of its own; the substation is the same for all."""
    names = {name: getattr(row, name) for name in NAMES if getattr(row, name, "") not in ("", SUBSTATION)}
    return replace(row, **{name: f"{text}_{k}" for name, text in names.items()})


def joined_copies(feeder: gp.Feeder, copies: int) -> gp.Feeder:
    """Return copies of a feeder, each joined to the one before by a line between their buses `JOINT`."""
    tables = {name: [of_copy(row, k) for k in range(1, copies + 1) for row in getattr(feeder, name)] for name in TABLES}
    tables["buses"] = list({bus.name: bus for bus in tables["buses"]}.values())
    of_three = next(line for line in tables["lines"] if line.phases == "ABC")
    for k in range(2, copies + 1):
        ends = {"from_bus": f"{JOINT}_{k - 1}", "to_bus": f"{JOINT}_{k}"}
        tables["lines"].append(replace(of_three, name=f"tie_{k}", **ends))
    return replace(feeder, spares=(), **{name: tuple(rows) for name, rows in tables.items()})


def measure(agents: int, T_c: float, end: float) -> dict[str, float]:
    """Return the costs; the plant's code is compiled, or loaded, before anything is timed."""
    with tempfile.TemporaryDirectory() as text:
        folder, copies = Path(text), agents // ISLAND
        feeder = joined_copies(gp.Feeder.read("microgrid123"), copies).save(folder / "grown")
        began = process_time()
        scenario = gp.Scenario(
            plant={"feeder": str(feeder)},
            time={"T_c_s": T_c, "end_s": end},
            event=[{"label": "islanding", "t_s": 1.0, "open": [f"13_{k}-152_{k}" for k in range(1, copies + 1)]}],
            case={"ring": {"secondary": "all", "graph": "ring"}},
        )
        read = process_time() - began
        plant, configured = configs(scenario.spec, scenario.feeder, "ring")
        built = build_plant(plant)
        timed_run(plant, configured, built, folder / "first")  # the first run of a process is slower
        began = process_time()
        built = build_plant(plant)
        build = process_time() - began
        plant_s, agents_s, clock_s = timed_run(plant, configured, built, folder / "run")
    return {
        "read_s": read,
        "build_s": build,
        "plant_per_s": plant_s / end,
        "agents_per_s": agents_s / end,
        "of_real_time": (agents_s + plant_s) / end,
        "by_the_clock": clock_s / end,
        "us_per_message": 1e6 * agents_s / (4 * agents) / (end / T_c),
        "memory_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3,
    }


def timed_run(plant: PlantConfig, agents: Any, built: Plant, folder: Path) -> tuple[float, float, float]:
    """Run and record one case in this process; return times (s) from its first row on.

    They are processor time of the plant at its interface and of all else, and the time by the clock.
    """
    assert plant.end is not None
    spent = 0.0
    first: list[tuple[float, float, float]] = []

    def timed(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            nonlocal spent
            began = process_time()
            try:
                return function(*arguments, **named)
            finally:
                spent += process_time() - began

        return call

    with ExitStack() as stack:
        for name in ("advance", "measure", "hold", "take_rows"):
            stack.enter_context(patch.object(Plant, name, timed(getattr(Plant, name))))
        recorder = stack.enter_context(Recorder(folder))

        def take(telemetry: Any) -> None:
            if not first:
                first.append((process_time(), spent, perf_counter()))
            recorder(telemetry)

        outcome = run_inprocess(plant, agents, take, plant=built)
        ended, all_spent, then = process_time(), spent, perf_counter()
        recorder.finish(plant.end, plant.record_step)
    if outcome.broke:
        raise RuntimeError(outcome.broke)
    at, before, since = first[0]
    plant_s = all_spent - before
    return plant_s, ended - at - plant_s, then - since


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]))))
