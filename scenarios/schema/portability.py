"""Whether other processes can import what a scenario plugs in."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from agents.carriers.law_registry import LAWS
from agents.graphs import GRAPHS
from netem.models.own_fault import FAULTS
from scenarios.results.evaluation.metric import METRICS
from scenarios.schema.graph import graph_of
from scenarios.schema.law_choice import law_of
from scenarios.schema.netem_tables import netem_of
from scenarios.schema.own_modules import metrics_of
from scenarios.schema.scenario_model import ScenarioModel
from wire.registry import PluginError, Registry


def check_portable(scenario: ScenarioModel, *, measures: bool = False) -> list[str]:
    """Return a sentence for everything in a scenario's cases that no other process could import.

    Parameters
    ----------
    scenario : ScenarioModel
        Checked.
    measures : bool, optional
        Whether other processes measure, too, as those of a sweep do; those of a run do not.
    """
    found = []
    for case in scenario.cases:
        for registry, use in _used(scenario, case, measures):
            try:
                registry.portable(use)
            except PluginError as error:
                found.append(f"case {case}: {error}")
    return list(dict.fromkeys(found))


def _used(scenario: ScenarioModel, case: str, measures: bool) -> Iterator[tuple[Registry[Any], str]]:
    yield LAWS, law_of(scenario, case).use
    _, graph = graph_of(scenario.cases[case])
    if graph is not None:
        yield GRAPHS, graph.use
    for fault in netem_of(scenario, case).links:
        for plugin in fault.own:
            yield FAULTS, plugin.use
    for _, metric in metrics_of(scenario) if measures else ():
        yield METRICS, metric.use
