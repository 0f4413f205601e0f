"""How fast one case of the islanding experiment runs, and where the time goes.

Three runs of the same 350 ticks in one go, so that ratios hold whatever else the machine does: all in one process, with
processes over Zenoh, and bare Zenoh with empty messages, the floor under any lock-step (`bench/floor.py`).

    .venv/bin/python bench/speed.py [--repeat 5] [--case IV]
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, before numpy is imported

import statistics
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import floor
from machine import machine

import wire.codec
from agents.agent import Agent
from plant.build import build_plant
from scenarios.drivers.inprocess import run_inprocess
from scenarios.drivers.process_driver import run_processes
from scenarios.results.record import Recorder
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs

IN_PROCESS_TARGET, PROCESSES_TARGET = 0.7, 4.0
"""Seconds for one case of 7 s simulated: warm in one process; with processes, their start included."""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=5, help="how often each is run; medians are shown")
    parser.add_argument("--case", default="IV", help="case of the islanding experiment")
    arguments = parser.parse_args()
    scenario, feeder = load_scenario("islanding")
    plant_config, agent_configs = configs(scenario, feeder, arguments.case)
    end = scenario.time.end_s
    ticks = round(end / plant_config.T_c)
    print(machine())
    print(
        f"islanding, case {arguments.case}: {end:g} s simulated, {ticks} ticks, "
        f"{round(end / plant_config.settings.h)} steps, {len(agent_configs)} agents; "
        f"medians of {arguments.repeat}\n"
    )
    with tempfile.TemporaryDirectory() as folder:
        cold = run_in_process(plant_config, agent_configs, Path(folder) / "first")
        rows: list[tuple[float, float, float, float]] = []
        for i in range(arguments.repeat):
            one = run_in_process(plant_config, agent_configs, Path(folder) / f"one{i}")
            start, run, whole = run_fleet(plant_config, agent_configs, Path(folder) / f"many{i}")
            rows.append((one, start, run, whole))
        bare = statistics.median(floor.measure(len(agent_configs), ticks) for _ in range(min(arguments.repeat, 3)))
        shares = breakdown(plant_config, agent_configs)
    one, start, run, whole = (statistics.median(column) for column in zip(*rows, strict=True))
    line("in one process, first run (loads the compiled step)", cold)
    fastest_one, _, _, fastest_whole = (min(column) for column in zip(*rows, strict=True))
    line("in one process, warm", one, f"{verdict(one, IN_PROCESS_TARGET)}; fastest {fastest_one:.3f} s")
    for name, seconds in shares.items():
        line(f"  {name}", seconds, f"{100 * seconds / sum(shares.values()):3.0f} %")
    line("with processes, start to end", whole, f"{verdict(whole, PROCESSES_TARGET)}; fastest {fastest_whole:.3f} s")
    line("  until the first row", start, "interpreters, imports, initial state, finding each other")
    line(f"  {ticks} ticks", run, f"{1e3 * run / ticks:.2f} ms a tick")
    line("  closing", whole - start - run)
    line("bare Zenoh, empty messages, same mesh", bare, f"{1e3 * bare / ticks:.2f} ms a tick")
    print()
    print(f"ticks with processes : bare Zenoh     {run / bare:5.2f}")
    print(f"ticks with processes : in one process {run / one:5.2f}")
    print(f"start to end         : in one process {whole / one:5.2f}")


def run_in_process(plant_config: Any, agent_configs: Any, folder: Path) -> float:
    """Return the time (s) of one case in this process, plant built and history written included."""
    began = perf_counter()
    with Recorder(folder) as recorder:
        outcome = run_inprocess(plant_config, agent_configs, recorder)
        recorder.finish(plant_config.end, plant_config.record_step)
    assert not outcome.broke, outcome.broke
    return perf_counter() - began


def run_fleet(plant_config: Any, agent_configs: Any, folder: Path) -> tuple[float, float, float]:
    """Time (s) of one case with processes: until the first row, from there to the last, and from start to end."""
    began = perf_counter()
    with Recorder(folder) as recorder:
        outcome = run_processes(plant_config, agent_configs, folder / "log", recorder)
        assert not outcome.broke, outcome.broke
        recorder.finish(plant_config.end, plant_config.record_step)
    return outcome.start_s, outcome.run_s, perf_counter() - began


def breakdown(plant_config: Any, agent_configs: Any) -> dict[str, float]:
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

    class TimedPlant:
        """A plant whose calls are timed."""

        def __init__(self, inner: Any) -> None:
            self._inner = inner
            self.advance = timed("plant: dynamics and network", inner.advance)
            self.measure = timed("plant: readings, set-points, rows", inner.measure)
            self.hold = timed("plant: readings, set-points, rows", inner.hold)
            self.take_rows = timed("plant: readings, set-points, rows", inner.take_rows)

        def __getattr__(self, name: str) -> Any:
            return getattr(self._inner, name)

    kept = Agent.tick
    codecs = [
        (module, name, function)
        for name, function in (("encode", wire.codec.encode), ("decode", wire.codec.decode))
        for module in list(sys.modules.values())
        if getattr(module, name, None) is function
    ]
    try:
        Agent.tick = timed("agents: the law", kept)  # type: ignore[method-assign]
        for module, name, function in codecs:
            setattr(module, name, timed("codec", function))
        began = perf_counter()
        built: Any = TimedPlant(timed("plant: tables and initial state", build_plant)(plant_config))
        run_inprocess(plant_config, agent_configs, lambda telemetry: None, plant=built)
        whole = perf_counter() - began
    finally:
        Agent.tick = kept  # type: ignore[method-assign]
        for module, name, function in codecs:
            setattr(module, name, function)
    shares = dict(sorted(spent.items(), key=lambda item: -item[1]))
    return shares | {"lock-step, bus, and the timing itself": whole - sum(spent.values())}


def verdict(seconds: float, target: float) -> str:
    """Return whether a target is met."""
    return f"{'meets' if seconds < target else 'MISSES'} the target of {target:g} s"


def line(what: str, seconds: float, remark: str = "") -> None:
    """Print one measurement."""
    print(f"{what:52} {seconds:6.3f} s   {remark}".rstrip())


if __name__ == "__main__":
    main()
