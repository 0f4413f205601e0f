"""How many sessions find each other: the time until each hears its neighbours, its links, and waves of churn.

`--sessions` sessions, hosted by `--processes` processes of their own and all opened at once, form the graph of
`--neighbours` neighbours each (a ring with chords). A session hears a neighbour once it has its liveliness token and a
message of it; every session sends one ten times a second. Then come `--waves` waves: ten sessions close, ten others
open in their place, and all must hear their neighbours again within `--deadline` s, or the wave counts as hanging.

    .venv/bin/python -m bench.discovery [--ways flat,hub] [--sessions 100] [--processes 4] [--neighbours 4] [--waves 30]
"""

from __future__ import annotations

import random
import sys
from contextlib import suppress
from statistics import median
from time import monotonic

from bench.discovery.discovery_run import Run
from bench.discovery.session_host import worker
from bench.discovery.ways_to_meet import HUB, WAYS, Places
from bench.harness import machine, options

LEFT = 10
"""Sessions that close in a wave, and that open."""


def measure(name: str, places: Places, waves: int, deadline: float) -> str:
    """Measure one way; return its row."""
    text, way = WAYS[name]
    run = Run(way, places)
    try:
        run.change("open", [HUB], deadline)
        since = monotonic()
        run.change("open", list(range(places.count)), deadline)
        took, links, deaf = run.until_all_hear(since, deadline)
        if took is None:
            return f"{name:15} not within {deadline:g} s: {deaf} of {places.count} do not hear all neighbours   {text}"
        rng, times, hung = random.Random(1), [], 0
        gates = [i for i in range(places.count) if i == 0 or places.process(i - 1) != places.process(i)]
        for _ in range(waves):
            left = rng.sample([i for i in range(places.count) if i not in gates], LEFT)
            since = monotonic()
            ok = run.change("close", left, deadline)
            for i in left:
                run.lives[i] += 1
            ok = ok and run.change("open", left, deadline)
            again, _, _ = run.until_all_hear(since, deadline) if ok else (None, [], 0)
            if again is None:
                hung += 1
                break  # what hangs once hangs
            times.append(again)
        churn = f"{median(times):.2f} (most {max(times):.2f})" if times else "-"
        spent = run.end()
        row = f"{name:15}{took:9.2f}{median(links):8g} (most {max(links)}){churn:>22}{len(times):4}{hung:6}{spent:9.1f}"
        return f"{row}   {text}"
    finally:
        with suppress(OSError):
            run.end()


def main() -> None:
    """Measure and print."""
    if sys.argv[1:] == ["worker"]:
        worker()
        return
    given = options(__doc__, ways=",".join(WAYS), sessions=100, processes=4, neighbours=4, waves=30, deadline=20)
    print(machine())
    print(f"{given.sessions} sessions in {given.processes} processes, {given.neighbours} neighbours each\n")
    print(f"{'way':15}{'meet (s)':>9}{'links':>8}{'':11}{'churn: wave (s)':>22}{'ok':>4}{'hung':>6}{'CPU (s)':>9}")
    for name in given.ways.split(","):
        print(
            measure(name, Places(given.sessions, given.processes, given.neighbours), given.waves, given.deadline),
            flush=True,
        )


if __name__ == "__main__":
    main()
