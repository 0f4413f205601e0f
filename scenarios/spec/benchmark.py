"""The key `paper` of a scenario: the benchmark that its runs are judged by."""

from __future__ import annotations

from pathlib import Path

from scenarios.results.benchmarks import BENCHMARKS
from scenarios.spec.mistakes import Mistakes
from scenarios.spec.model import Scenario
from wire.nearest import suggestion
from wire.registry import PluginError


def check_benchmark(scenario: Scenario, folder: Path, mistakes: Mistakes) -> None:
    """Note a benchmark that is not there; a module of one's own may stand in the folder of the scenario.

    Those that are known by name are not imported before a run is judged: to read a scenario takes no numpy.
    """
    name = scenario.paper
    if mistakes.touch("paper") or not name or name in BENCHMARKS.names:
        return
    if ":" not in name:
        hint = suggestion(name, BENCHMARKS.names, "benchmarks")
        mistakes.add("paper", f'there is no "{name}"; {hint}; your own is written module:Name')
        return
    try:
        BENCHMARKS.resolve(name, str(folder.absolute()))
    except PluginError as error:
        mistakes.add("paper", str(error))
