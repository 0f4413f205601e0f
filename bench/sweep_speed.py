"""Seconds per run of a sweep on all cores, against a plain loop over some of the same runs.

The loop is what anybody would write: change the scenario, run it, measure it, one after the other, a new plant each
time. The sweep reuses plants.

    .venv/bin/python -m bench.sweep_speed [--runs 500] [--loop 20]
"""

from __future__ import annotations

import os
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter, process_time

import gridpeers as gp
from bench.harness import machine, options, ratios

CASE = "IV"


def main() -> None:
    """Measure and print."""
    given = options(__doc__, runs=500, loop=20)
    scenario = gp.load("islanding").replace({"paper": None})
    values = [0.5 + 1.5 * i / given.runs for i in range(given.runs)]
    half = values[: max(given.loop // 2, 1)]
    busy: list[float] = []

    def loop() -> float:
        """Return the time (s) per run of half of the loop; it comes before and after the sweep."""
        began, began_busy = perf_counter(), process_time()
        for alpha in half:
            _ = scenario.replace({"gains.alpha": alpha}).run(CASE).metrics
        busy.append((process_time() - began_busy) / len(half))
        return (perf_counter() - began) / len(half)

    def sweep() -> float:
        """Return the time (s) per run of the sweep, with the start of its workers."""
        began = perf_counter()
        rows = gp.sweep(scenario, {"gains.alpha": values}, cases=[CASE])
        assert len(rows) == len(values)
        return (perf_counter() - began) / len(values)

    loop()  # loads the compiled step for all of them
    print(machine())
    print(f"islanding, case {CASE}, 7 s simulated a run; {2 * len(half)} runs in the loop, {given.runs} in the sweep\n")
    measured = ratios({"a run in the plain loop": loop, "a run in the sweep": sweep}, rounds=1)
    workers = getrusage(RUSAGE_CHILDREN)
    each = (workers.ru_utime + workers.ru_stime) / given.runs
    print(f"\nprocessor time of a run: loop {1e3 * min(busy):.0f} ms, workers {1e3 * each:.0f} ms with their start")
    print(f"runs per second, sweep : loop {1.0 / measured['a run in the sweep']:.2f}, on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()
