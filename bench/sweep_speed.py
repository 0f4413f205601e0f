"""Runs per second of a sweep on all cores, against a plain loop over some of the same runs.

The loop is what anybody would write: change the scenario, run it, measure it, one after the other, a new plant each
time. The sweep reuses plants. Half of the loop runs before the sweep and half after it, so that the ratio holds
whatever else the machine does.

    .venv/bin/python bench/sweep_speed.py [--runs 500] [--loop 20]
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter, process_time

from harness import machine, options

import gridpeers as gp

CASE = "IV"


def main() -> None:
    """Measure and print."""
    given = options(__doc__, runs=500, loop=20)
    scenario = gp.load("islanding").replace({"paper": None})
    values = [0.5 + 1.5 * i / given.runs for i in range(given.runs)]
    half = max(given.loop // 2, 1)

    def loop(some: Sequence[float]) -> float:
        """Return the time (s) of runs one after the other."""
        began = perf_counter()
        for alpha in some:
            _ = scenario.replace({"gains.alpha": alpha}).run(CASE).metrics
        return perf_counter() - began

    loop(values[:1])  # loads the compiled step for all of them
    busy = process_time()
    before = loop(values[:half])
    busy = process_time() - busy
    began = perf_counter()
    rows = gp.sweep(scenario, {"gains.alpha": values}, cases=[CASE])
    swept = perf_counter() - began
    workers = getrusage(RUSAGE_CHILDREN)
    after = loop(values[half : 2 * half])
    assert len(rows) == given.runs
    one, all_cores = 2 * half / (before + after), given.runs / swept
    print(machine())
    print(f"islanding, case {CASE}, 7 s simulated a run\n")
    print(f"plain loop, {2 * half} runs           {before + after:7.2f} s   {one:6.2f} runs per second")
    print(f"sweep on all cores, {given.runs} runs  {swept:7.2f} s   {all_cores:6.2f} runs per second")
    once, each = 1e3 * busy / half, 1e3 * (workers.ru_utime + workers.ru_stime) / given.runs
    print(f"\nprocessor time of a run: loop {once:.0f} ms, workers {each:.0f} ms, their start included")
    print(f"sweep : plain loop {all_cores / one:5.2f}   (of which cores: at most {os.cpu_count()})")


if __name__ == "__main__":
    main()
