"""The keys `paper`, `metrics` and `claims`: by what a scenario's runs are measured and judged."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from msgspec.structs import replace

from scenarios.results.evaluation.benchmark_registry import BENCHMARKS, CLAIMS
from scenarios.results.evaluation.metric import ALWAYS, METRICS, good_name, name_of
from scenarios.schema.plugins import check_plugin, placed
from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import PluginKey, ScenarioModel
from wire.plugin import Plugin, plugin_of, table_of
from wire.registry import Registry


def metrics_of(scenario: ScenarioModel) -> list[tuple[str, Plugin]]:
    """Return a scenario's own metrics: the name of each in tables, and the metric."""
    found = []
    for key in scenario.metrics:
        table = table_of(key)
        label = str(table.pop("name", ""))
        plugin = plugin_of(table)
        found.append((name_of(plugin, label), plugin))
    return found


def claims_of(scenario: ScenarioModel) -> list[Plugin]:
    """Return a scenario's own claims."""
    return [plugin_of(key) for key in scenario.claims]


def with_own_folders(scenario: ScenarioModel, folder: Path) -> ScenarioModel:
    """Return the scenario with the folder of each metric and claim that stands beside its file."""
    return replace(
        scenario,
        metrics=tuple(_placed_metric(key, folder) for key in scenario.metrics),
        claims=tuple(placed(key, CLAIMS, folder) for key in scenario.claims),
    )


def check_own(scenario: ScenarioModel, problems: Problems) -> None:
    """Note metrics and claims that there are not, and metrics of one name."""
    names: list[str] = []
    for i, key in enumerate(scenario.metrics):
        path, table = f"metrics[{i}]", table_of(key)
        label = table.pop("name", "")
        if not isinstance(label, str) or (label and not good_name(label)):
            problems.add(f"{path}.name", "a name in tables is up to 41 letters, digits and _, the unit last: f_min_Hz")
            continue
        plugin = _checked(path, key, table, METRICS, problems)
        if plugin is None:
            continue
        name = name_of(plugin, label)
        if name in ALWAYS and plugin.use != name:
            problems.add(
                path, f'every run has a metric "{name}" already; give this one a name: {{ name = "my_{name}" }}'
            )
        elif name in names:
            problems.add(path, f'there is a metric "{name}" in this list already; give one of them another name')
        names.append(name)
    for i, key in enumerate(scenario.claims):
        _checked(f"claims[{i}]", key, table_of(key), CLAIMS, problems)


def _checked(
    path: str, key: PluginKey, table: dict[str, Any], registry: Registry[Any], problems: Problems
) -> Plugin | None:
    return check_plugin(path, key if isinstance(key, str) else table, registry, problems)


def _placed_metric(key: PluginKey, folder: Path) -> PluginKey:
    """A metric as any process can follow it; one of a decorator's name keeps that name in tables."""
    table = table_of(key)
    use = str(table.get("use", ""))
    if METRICS.reference(use) != use and "name" not in table and good_name(use):
        key = table | {"name": use}
    return placed(key, METRICS, folder)


def with_benchmark_folder(scenario: ScenarioModel, folder: Path) -> ScenarioModel:
    """Return the scenario with the folder of a benchmark that stands beside its file."""
    return replace(scenario, paper=placed(scenario.paper, BENCHMARKS, folder)) if scenario.paper else scenario


def check_benchmark(scenario: ScenarioModel, problems: Problems) -> None:
    """Note a benchmark that is not there.

    One that is known by name is not imported before a run is judged: to read a scenario takes no numpy.
    """
    name = scenario.paper
    if problems.touch("paper") or not name or (isinstance(name, str) and name in BENCHMARKS.names):
        return
    check_plugin("paper", name, BENCHMARKS, problems)
