"""Our side: the islanding experiment, case IV: its plant, one case by each driver, the command, a sweep."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import cached_property
from pathlib import Path
from time import perf_counter, process_time, sleep
from typing import Any
from unittest.mock import patch

import gridpeers as gp
from bench.harness import DEADLINE, GRIDPEERS, checked, processor_time
from gridpeers.bridges.gridlabd import gridlabd_plant
from gridpeers.bridges.gridlabd.gridlabd_plant import GridlabdPlant
from gridpeers.plant.build import build_plant
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.record.record_info import FILE
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.scenarios.results.record import Recorder
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.node import Publish
from gridpeers.wire.post import Post

CASE = "IV"

LOOK = 0.002
"""Time (s) between two looks at the record that is being written."""


class OurCase:
    """The islanding experiment, case IV: nine agents, full graph, T_c 20 ms, h 2 ms; 7 s, or until another end (s)."""

    def __init__(self, end: float | None = None) -> None:
        scenario = gp.load("islanding").replace({"paper": None})
        if end is not None:
            first = scenario.tables["event"][0]
            scenario = scenario.replace({"event": [first | {"t_s": end / 2.0}], "time.end_s": end})
        self.scenario = scenario
        self.plant, self.agents = configs(scenario.spec, scenario.feeder, CASE)
        assert self.plant.end is not None
        self.end = self.plant.end
        self.ticks = round(self.end / self.plant.T_c)

    def plant_alone(self) -> dict[str, float]:
        """Measure the plant with constant set-points: processor time (s) of its build and of its steps."""
        began = process_time()
        plant = build_plant(self.plant)
        built = process_time()
        for _ in range(self.ticks):
            plant.advance()
        return {"ours.plant.build": built - began, "ours.plant.steps": process_time() - built}

    def gridlabd_alone(self) -> dict[str, float]:
        """Measure GridLAB-D through the same events: processor time (s) of its steps, its start not counted.

        It is as it is installed, without the settings of memory that it has as the plant of our runs.
        """
        ours = build_plant(self.plant)
        with (
            patch.object(gridlabd_plant, "KEPT_MEMORY", {}),
            closing(GridlabdPlant(ours, self.plant.settings, self.plant.T_c, self.end)) as plant,
        ):
            started = processor_time(plant.process.pid)
            for _ in range(self.ticks):
                plant.advance()
            steps = processor_time(plant.process.pid) - started
        return {"gridlabd.plant.steps": steps}

    def in_process(self) -> dict[str, float]:
        """Measure one case in this process, processor time (s): tables are read, plant built and history written."""
        with tempfile.TemporaryDirectory() as folder:
            began = process_time()
            with Recorder(Path(folder) / CASE) as recorder:
                outcome = run_inprocess(self.plant, self.agents, recorder)
                recorder.finish(self.end, self.plant.record_step)
            took = process_time() - began
        _check(outcome.broke)
        return {"ours.case.inprocess": took}

    def with_processes(self, shared: int = 0) -> dict[str, float]:
        """Measure one case with processes (s): the whole, until its first row, and each tick.

        Plant and agents are forked from what a former case has started.
        """
        kind = f"{shared or len(self.agents)}"
        with tempfile.TemporaryDirectory() as name:
            folder, began = Path(name), perf_counter()
            with Recorder(folder / CASE) as recorder:
                outcome = run_processes(self.plant, self.agents, folder / "log", recorder, shared=shared)
                _check(outcome.broke)
                recorder.finish(self.end, self.plant.record_step)
            whole = perf_counter() - began
        return {
            f"ours.tick.{kind}": outcome.run_s / outcome.ticks,
            f"ours.first_row.{kind}": outcome.start_s,
            f"ours.case.{kind}": whole,
        }

    def by_command(self) -> dict[str, float]:
        """Measure `gridpeers run` with processes (s) from its start: to its first row, to its last, and to its end.

        The last row is there once there is history.csv; measures and figures follow.
        """
        with tempfile.TemporaryDirectory(prefix="gp-command-") as name:
            folder = Path(name)
            file, out, log = folder / "islanding.toml", folder / "out", folder / "log"
            file.write_text(self.scenario.to_toml(), encoding="utf-8")
            command = [*GRIDPEERS, "run", str(file), "--case", CASE, "--driver", "processes", "--out", str(out)]
            with log.open("wb") as errors:
                began = perf_counter()
                run = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=errors, stderr=errors)
                try:
                    first = _until(run, lambda: _has_row(out / CASE / FILE)) - began
                    last = _until(run, (out / CASE / "history.csv").exists) - began
                    run.wait(DEADLINE)
                    end = perf_counter() - began
                finally:
                    run.kill()
                    run.wait()
            if run.returncode:
                raise subprocess.CalledProcessError(run.returncode, command, stderr=log.read_text(errors="replace"))
        return {"ours.command.first_row": first, "ours.command.last_row": last, "ours.command.end": end}

    def sweep(self, runs: int) -> dict[str, float]:
        """Measure a sweep over all cores: runs per second once its workers run, and time (s) until they do."""
        values = [0.5 + 1.5 * i / runs for i in range(runs)]
        done: list[float] = []
        began = perf_counter()
        rows = gp.sweep(
            self.scenario, {"gains.alpha": values}, cases=[CASE], progress=lambda *_: done.append(perf_counter())
        )
        _check("; ".join(rows["why"][rows["status"] != "ran"]))
        first = min(os.cpu_count() or 1, runs - 1)  # each worker's first run loads the compiled step
        return {
            "ours.sweep": (runs - first) / (done[-1] - done[first - 1]),
            "ours.sweep.start": done[0] - began,
            "ours.sweep.whole": runs / (done[-1] - began),
        }

    @cached_property
    def sizes(self) -> tuple[int, int]:
        """Bytes of a measurement and of a state, as they are published in this case; medians."""
        sizes: dict[str, list[int]] = {"measurement": [], "state": []}

        def noted(take: Callable[[Any], Any]) -> Callable[[Any], Any]:
            def call(node: Any) -> Any:
                actions = take(node)
                for action in actions:
                    if isinstance(action, Publish):
                        for kind, found in sizes.items():
                            if f"/{kind}/" in action[0]:
                                found.append(len(action[1]))
                return actions

            return call

        with ExitStack() as stack:
            stack.enter_context(patch.object(Post, "take_actions", noted(Post.take_actions)))
            _check(run_inprocess(self.plant, self.agents, lambda telemetry: None, messages=True).broke)
        measurement, state = (sorted(found)[len(found) // 2] for found in sizes.values())
        return measurement, state


def help_time() -> dict[str, float]:
    """Measure `gridpeers --help` (s)."""
    began = perf_counter()
    checked([*GRIDPEERS, "--help"])
    return {"ours.help": perf_counter() - began}


def _until(run: subprocess.Popen[bytes], happened: Callable[[], bool]) -> float:
    """Return the time at which something has happened, or the command has ended."""
    until = perf_counter() + DEADLINE
    while run.poll() is None and perf_counter() < until and not happened():
        sleep(LOOK)
    return perf_counter()


def _has_row(file: Path) -> bool:
    try:
        return next(RunRecord.open(file).telemetry(), None) is not None
    except RecordFileError:  # it begins
        return False


def _check(broke: str) -> None:
    if broke:
        raise RuntimeError(broke)
