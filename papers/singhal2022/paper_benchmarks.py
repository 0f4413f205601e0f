"""Benchmarks: the paper's numbers and claims for a run of each experiment, named in the scenario's key `paper`."""

from __future__ import annotations

from gridpeers.benchmarks import Benchmark
from gridpeers.papers.singhal2022.claims import CLAIMS
from gridpeers.papers.singhal2022.headline import headline, numbers
from gridpeers.papers.singhal2022.tables import tables_of


def _benchmark(experiment: str) -> Benchmark:
    tables = tables_of(experiment)
    return Benchmark(
        numbers=tuple(cell for table in tables for cell in table.cells),
        claims=CLAIMS[experiment],
        summary=lambda found: headline(numbers(found, tables)),
    )


ISLANDING = _benchmark("islanding")
INTERMITTENCY = _benchmark("intermittency")
COMMUNICATION = _benchmark("communication")
SWITCHING = _benchmark("switching")
PLUG_N_PLAY = _benchmark("plug-n-play")
WIND_UP = _benchmark("wind-up")
