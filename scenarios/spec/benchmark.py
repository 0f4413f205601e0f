"""The key `paper` of a scenario: the benchmark that its runs are judged by."""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from scenarios.results.benchmark_registry import BENCHMARKS
from scenarios.spec.plugins import check_plugin, placed
from scenarios.spec.scenario_errors import Mistakes
from scenarios.spec.scenario_model import Scenario


def with_benchmark_folder(scenario: Scenario, folder: Path) -> Scenario:
    """Return the scenario with the folder of a benchmark that stands beside its file."""
    return replace(scenario, paper=placed(scenario.paper, BENCHMARKS, folder)) if scenario.paper else scenario


def check_benchmark(scenario: Scenario, mistakes: Mistakes) -> None:
    """Note a benchmark that is not there.

    One that is known by name is not imported before a run is judged: to read a scenario takes no numpy.
    """
    name = scenario.paper
    if mistakes.touch("paper") or not name or (isinstance(name, str) and name in BENCHMARKS.names):
        return
    check_plugin("paper", name, BENCHMARKS, mistakes)
