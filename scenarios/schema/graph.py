"""The key `graph` of a case: a rule of gridpeers, or one's own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import get_args

from msgspec.structs import replace

from agents.agent_config import GraphRule
from agents.graphs import GRAPHS, make_graph, neighbours_by
from plant.equipment import Feeder, InverterRow
from scenarios.schema.participants import with_agent
from scenarios.schema.plugins import check_plugin, placed
from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import Case, ScenarioModel
from wire.plugin import Plugin, plugin_of

OURS = get_args(GraphRule)
"""Rules of gridpeers, which need no module."""


def graph_of(case: Case) -> tuple[str, Plugin | None]:
    """Return the name of a case's rule, and the rule if it is one's own.

    Examples
    --------
    >>> graph_of(Case(secondary="all", graph="ring"))
    ('ring', None)
    """
    plugin = plugin_of(case.graph)
    return (plugin.use, None) if plugin.use in OURS else (plugin.name, plugin)


def with_graph_folders(scenario: ScenarioModel, folder: Path) -> ScenarioModel:
    """Return the scenario with the folder of each rule that stands beside its file."""
    cases = {name: replace(case, graph=placed(case.graph, GRAPHS, folder)) for name, case in scenario.cases.items()}
    return replace(scenario, cases=cases)


def check_graphs(scenario: ScenarioModel, feeder: Feeder | None, problems: Problems) -> None:
    """Note rules that there are not, and that fail on a roster which the scenario will have."""
    for name, case in scenario.cases.items():
        path = f"case.{name}.graph"
        if problems.touch(path):
            continue
        plugin = check_plugin(path, case.graph, GRAPHS, problems)
        if plugin is None or plugin.use in OURS or feeder is None:
            continue
        try:
            rule = make_graph(plugin)
            for roster in _rosters(scenario, feeder, name):
                neighbours_by(rule, roster, plugin.name, strict=True)
        except ValueError as error:  # a `GraphError`, or a `PluginError` of one that cannot be called
            problems.add(path, str(error))


def _rosters(scenario: ScenarioModel, feeder: Feeder, case: str) -> Iterator[dict[str, InverterRow]]:
    """Nameplates of those that take part at the start, and after each event at which agents leave or join."""
    rows = with_agent(scenario, feeder, case)
    present = {row.name for row in rows if not row.spare}
    yield {row.name: row for row in rows if row.name in present}
    for event in scenario.events:
        if event.leave or event.join:
            present = (present - set(event.leave)) | set(event.join)
            yield {row.name: row for row in rows if row.name in present}
