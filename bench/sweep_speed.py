"""How many runs a second a sweep does on all cores, against a plain loop over some of the same runs.

The loop does what anybody would write: check the scenario, run it, measure it, one after the other, a new plant each
time. The sweep is `gridpeers sweep` without its plots: it keeps every run on the disk as it comes, and reuses plants.
Both are measured in one go, the loop half before and half after the sweep, so that the ratio holds whatever else the
machine does.

    .venv/bin/python bench/sweep_speed.py [--runs 500] [--loop 20]
"""

from __future__ import annotations

import resource
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter, process_time

from harness import machine, options

from plant.tables import read_feeder
from scenarios.drivers.inprocess import run_inprocess
from scenarios.results import metrics
from scenarios.results.event_windows import windows
from scenarios.results.history import History, Nameplates
from scenarios.results.record import Recorder
from scenarios.schema.configs import as_in, configs
from scenarios.sweep.file import Plan, Run, read_sweep
from scenarios.sweep.sweep_case import run_one
from scenarios.sweep.sweep_folder import SweepFolder
from scenarios.sweep.workers import cores, on_this_machine

SWEEP = """
scenario = "islanding"
cases = ["IV"]

[set]
paper = ""

[random]
samples = {runs}
[random.keys]
"gains.k_p" = {{ loguniform = [3e-4, 3e-3] }}
"gains.alpha" = {{ uniform = [0.5, 2.0] }}
"""


def main() -> None:
    """Measure and print."""
    given = options(__doc__, runs=500, loop=20)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "bench.toml").write_text(SWEEP.format(runs=given.runs), encoding="utf-8")
        began = perf_counter()
        plan = read_sweep(folder / "bench.toml")
        read = perf_counter() - began
        run_one(0, plan.runs[0].scenario, plan.runs[0].case)  # loads the compiled step for all of them
        half = max(given.loop // 2, 1)
        busy = process_time()
        before = loop(plan.runs[:half], folder / "before")
        busy = process_time() - busy
        swept = sweep(plan, folder / "sweep")
        workers = resource.getrusage(resource.RUSAGE_CHILDREN)
        after = loop(plan.runs[half : 2 * half], folder / "after")
    one, all_cores = 2 * half / (before + after), len(plan.runs) / swept
    print(machine())
    print(f"islanding, case IV: {plan.base.time.end_s:g} s simulated a run\n")
    print(f"{len(plan.runs)} samples checked            {read:7.2f} s   {1e3 * read / len(plan.runs):.1f} ms a sample")
    print(f"plain loop, {2 * half} runs           {before + after:7.2f} s   {one:6.2f} runs per second")
    print(f"sweep on all cores, {len(plan.runs)} runs  {swept:7.2f} s   {all_cores:6.2f} runs per second")
    once, each = 1e3 * busy / half, 1e3 * (workers.ru_utime + workers.ru_stime) / len(plan.runs)
    print(f"\nprocessor time of a run: loop {once:.0f} ms, workers {each:.0f} ms, their start included")
    print(f"sweep : plain loop {all_cores / one:5.2f}   (of which cores: at most {cores()})")


def loop(runs: Sequence[Run], folder: Path) -> float:
    """Return the time (s) of runs one after the other."""
    began = perf_counter()
    for number, run in enumerate(runs):
        scenario = run.scenario
        feeder = as_in(scenario, read_feeder(scenario.plant.feeder, scenario.plant.load_set))
        plant, agents = configs(scenario, feeder, run.case)
        with Recorder(folder / str(number)) as recorder:
            outcome = run_inprocess(plant, agents, recorder)
            assert not outcome.broke, outcome.broke
            recorded = recorder.finish(scenario.time.end_s, plant.record_step)
        history = History.of(recorded.inverters, recorded.rows)
        for window in windows([(event.label, event.t_s) for event in scenario.events], scenario.time.end_s):
            metrics.measure(history, Nameplates.of(feeder.inverters), window, feeder.f_nom)
    return perf_counter() - began


def sweep(plan: Plan, folder: Path) -> float:
    """Return the time (s) of all runs on all cores, the start of the workers included."""
    began = perf_counter()
    with SweepFolder(folder, plan) as opened:
        for done in on_this_machine(list(enumerate(plan.runs)), cores(), run_one):
            assert done.status == "ran", done.why
            opened.add(done)
    return perf_counter() - began


if __name__ == "__main__":
    main()
