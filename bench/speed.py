"""The speed of one case of the islanding experiment, and the parts of its time.

Three runs of the same 350 ticks in one go, so that ratios hold whatever else the machine does: all in one process, with
processes over Zenoh, and bare Zenoh with empty messages, the floor under any lock-step (`bench/floor.py`).

    .venv/bin/python -m bench.speed [--repeat 5] [--case IV]
"""

from __future__ import annotations

import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any
from unittest.mock import patch

import wire.codec
from agents.agent import Agent
from agents.agent_config import AgentConfig
from bench import floor
from bench.harness import machine, options, ratios
from plant.build import build_plant
from plant.feeder import Plant
from plant.plant_config import PlantConfig
from scenarios.drivers.inprocess import run_inprocess
from scenarios.drivers.process_driver import run_processes
from scenarios.results.record import Recorder
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs

IN_PROCESS_TARGET, PROCESSES_TARGET = 0.7, 4.0
"""Seconds for one case of 7 s simulated: warm in one process; with processes, their start included."""


class TimedCase:
    """One case, run by both drivers into a folder each."""

    def __init__(self, plant: PlantConfig, agents: tuple[AgentConfig, ...], folder: Path) -> None:
        assert plant.end is not None
        self.plant, self.agents, self._end = plant, agents, plant.end
        self._folders = (folder / str(number) for number in count())
        self.starts: list[float] = []
        self.whole: list[float] = []
        """Times (s) of each run with processes: until its first row, and in all."""

    def in_one_process(self) -> float:
        """Return the time (s) of a run in this process, plant built and history written included."""
        began = perf_counter()
        with Recorder(next(self._folders)) as recorder:
            outcome = run_inprocess(self.plant, self.agents, recorder)
            recorder.finish(self._end, self.plant.record_step)
        assert not outcome.broke, outcome.broke
        return perf_counter() - began

    def with_processes(self) -> float:
        """Return the time (s) of the ticks of a run with processes."""
        folder, began = next(self._folders), perf_counter()
        with Recorder(folder) as recorder:
            outcome = run_processes(self.plant, self.agents, folder / "log", recorder)
            assert not outcome.broke, outcome.broke
            recorder.finish(self._end, self.plant.record_step)
        self.starts.append(outcome.start_s)
        self.whole.append(perf_counter() - began)
        return outcome.run_s

    def shares(self) -> dict[str, float]:
        """Return the seconds by part of a warm run in one process, timed at the borders of the parts."""
        spent: defaultdict[str, float] = defaultdict(float)

        def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
            def call(*arguments: Any, **named: Any) -> Any:
                began = perf_counter()
                try:
                    return function(*arguments, **named)
                finally:
                    spent[part] += perf_counter() - began

            return call

        borders: list[tuple[str, Any, str]] = [
            ("plant: dynamics and network", Plant, "advance"),
            *(("plant: readings, set-points, rows", Plant, name) for name in ("measure", "hold", "take_rows")),
            ("agents: the law", Agent, "tick"),
        ]
        for function in (wire.codec.encode, wire.codec.decode):
            name = function.__name__
            owners = [module for module in list(sys.modules.values()) if getattr(module, name, None) is function]
            borders += [("codec", module, name) for module in owners]
        with ExitStack() as stack:
            for part, owner, name in borders:
                stack.enter_context(patch.object(owner, name, timed(part, getattr(owner, name))))
            began = perf_counter()
            built = timed("plant: tables and initial state", build_plant)(self.plant)
            run_inprocess(self.plant, self.agents, lambda telemetry: None, plant=built)
            whole = perf_counter() - began
        return dict(spent) | {"lock-step, bus, and the timing itself": whole - sum(spent.values())}


def main() -> None:
    """Measure and print."""
    given = options(__doc__, repeat=5, case="IV")
    scenario, feeder = load_scenario("islanding")
    plant, agents = configs(scenario, feeder, given.case)
    end = scenario.time.end_s
    ticks, steps = round(end / plant.T_c), round(end / plant.settings.h)
    print(machine())
    print(f"islanding, case {given.case}: {end:g} s simulated, {ticks} ticks, {steps} steps, {len(agents)} agents\n")
    with tempfile.TemporaryDirectory() as folder:
        case = TimedCase(plant, agents, Path(folder))
        print(f"in one process, first run (loads the compiled step) {case.in_one_process():.3f} s\n")
        warm: list[float] = []

        def in_one_process() -> float:
            warm.append(case.in_one_process())
            return warm[-1]

        rivals = {
            f"bare Zenoh, empty messages, same mesh, {ticks} ticks": lambda: floor.measure(len(agents), ticks),
            "in one process, warm": in_one_process,
            f"with processes, {ticks} ticks": case.with_processes,
        }
        ratios(rivals, given.repeat)
        shares = case.shares()
    print(f"\nwith processes, until the first row {median(case.starts):.3f} s: imports, finding each other")
    for what, seconds, target in (
        ("in one process, warm", median(warm), IN_PROCESS_TARGET),
        ("with processes, start to end", median(case.whole), PROCESSES_TARGET),
    ):
        print(f"{what} {seconds:.3f} s: {'meets' if seconds < target else 'MISSES'} the target of {target:g} s")
    print("\nparts of a warm run in one process")
    for part, seconds in sorted(shares.items(), key=lambda item: -item[1]):
        print(f"  {part:46} {seconds:6.3f} s {100 * seconds / sum(shares.values()):3.0f} %")


if __name__ == "__main__":
    main()
