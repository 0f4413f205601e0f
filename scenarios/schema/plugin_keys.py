"""The keys of a scenario that name plug-ins: laws, graphs, metrics, claims, checks, faults and their folders."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from msgspec.structs import replace

from gridpeers.agents.agent_config import Gains, GraphRule, LawChoice
from gridpeers.agents.carriers.law_check import PAPER, law_problems
from gridpeers.agents.carriers.law_registry import KEYS, LAWS, shared_by
from gridpeers.agents.graphs import GRAPHS, check_graph, make_graph
from gridpeers.netem.models.own_fault import FAULTS
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.plant.inverters.inverter_registry import INVERTERS, given
from gridpeers.scenarios.checks.check_registry import ALWAYS as ALWAYS_CHECKED
from gridpeers.scenarios.checks.check_registry import CHECKS, LAW_FAILED, check_name, switched_off
from gridpeers.scenarios.results.claims import BENCHMARKS, CLAIMS
from gridpeers.scenarios.results.metric import ALWAYS, METRICS, good_name, name_of
from gridpeers.scenarios.schema.participants import with_agent
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import Case, PluginKey, ScenarioModel
from gridpeers.wire.plugins.plugin import Plugin, plugin_of, plugin_problems, scalar_objection, table_of
from gridpeers.wire.plugins.registry import PluginError, Registry, folder_of
from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.wording import is_no_path

OUR_GRAPHS = get_args(GraphRule)


def law_of(scenario: ScenarioModel, case: str) -> LawChoice:
    table = table_of(scenario.cases[case].law or scenario.law)
    choice, _ = read_table(LawChoice, {key: value for key, value in table.items() if key in KEYS})
    parameters = {key: value for key, value in table.items() if key not in KEYS}
    return replace(choice, parameters=parameters, shared=shared_by(choice))


def graph_of(case: Case) -> tuple[str, Plugin | None]:
    plugin = plugin_of(case.graph)
    return (plugin.use, None) if plugin.use in OUR_GRAPHS else (plugin.use, plugin)


def metrics_of(scenario: ScenarioModel) -> list[tuple[str, Plugin]]:
    found = []
    for key in scenario.metrics:
        table = table_of(key)
        label = str(table.pop("name", ""))
        plugin = plugin_of(table)
        found.append((name_of(plugin, label), plugin))
    return found


def claims_of(scenario: ScenarioModel) -> list[Plugin]:
    return [plugin_of(key) for key in scenario.claims]


def judges_laws(scenario: ScenarioModel) -> bool:
    """Return False if the scenario has switched off the check that fails a run with a law."""
    return LAW_FAILED not in switched_off(scenario.checks)


def with_folders(scenario: ScenarioModel, folder: Path) -> ScenarioModel:
    """Return the scenario with the folder of each plug-in beside its file, so that any process can find it."""

    def place(key: PluginKey, registry: Registry[Any]) -> PluginKey:
        return placed(key, registry, folder)

    cases = {
        name: replace(
            case, graph=place(case.graph, GRAPHS), law=place(case.law, LAWS), netem=_with_faults(case.netem, folder)
        )
        for name, case in scenario.cases.items()
    }
    return replace(
        scenario,
        paper=place(scenario.paper, BENCHMARKS),
        law=place(scenario.law, LAWS),
        metrics=tuple(place(_labelled(key, METRICS), METRICS) for key in scenario.metrics),
        claims=tuple(place(key, CLAIMS) for key in scenario.claims),
        checks=tuple(place(_labelled(key, CHECKS), CHECKS) for key in scenario.checks),
        netem=_with_faults(scenario.netem, folder),
        cases=cases,
    )


def with_model_folders(data: Mapping[str, Any], folder: Path) -> Mapping[str, Any]:
    """Return the tables of a scenario with the folder of each inverter model beside its file."""
    plant = data.get("plant")
    if not isinstance(plant, Mapping):
        return data

    def change(table: Any) -> Any:
        name = table.get("model") if isinstance(table, Mapping) else None
        if not isinstance(name, str):
            return table
        key = placed({"use": name, "folder": table.get("folder") or ""}, INVERTERS, folder)
        return {**table, "model": key["use"], "folder": key["folder"]} if key["folder"] else table  # type: ignore[index]

    tables = {key: change(plant[key]) for key in ("gfm", "gfl") if key in plant}
    if isinstance(units := plant.get("inverter"), Mapping):
        tables["inverter"] = {name: change(table) for name, table in units.items()}
    return {**data, "plant": {**plant, **tables}}


def placed(key: PluginKey, registry: Registry[Any], folder: Path) -> PluginKey:
    """Return a key with the folder of its module, program or FMU, and a decorator's name as `module:Name`."""
    table = table_of(key)
    use, given = registry.reference(str(table.get("use", ""))), table.get("folder", "")
    local = ":" in use or "command" in table or "fmu" in table
    if not local or not isinstance(given, str) or is_no_path(given):
        return key
    place = str((folder / given).resolve())
    return table | ({"use": use, "folder": folder_of(use, place)} if ":" in use else {"folder": place})


def _with_faults(netem: Netem, folder: Path) -> Netem:
    links = []
    for fault in netem.links:
        keys = ({**dict(it.parameters), "use": it.use, "folder": it.folder} for it in fault.own)
        links.append(replace(fault, own=tuple(plugin_of(placed(key, FAULTS, folder)) for key in keys)))
    return replace(netem, links=tuple(links))


def _labelled(key: PluginKey, registry: Registry[Any]) -> PluginKey:
    """Return a metric or check with a name in tables: one of a decorator's name keeps that name."""
    table = table_of(key)
    use = str(table.get("use", ""))
    return table | {"name": use} if registry.reference(use) != use and "name" not in table and good_name(use) else key


def check_plugins(scenario: ScenarioModel, feeder: Tables | None, problems: Problems) -> None:
    key = scenario.paper  # one known by name is not imported before a run is judged: to read a scenario takes no numpy
    if not problems.touch("paper") and key and not (isinstance(key, str) and key in BENCHMARKS.names):
        _check("paper", key, BENCHMARKS, problems)
    _check_named("metrics", scenario.metrics, METRICS, ALWAYS, problems)
    for i, key in enumerate(scenario.claims):
        _check(f"claims[{i}]", key, CLAIMS, problems)
    _check_named("checks", scenario.checks, CHECKS, ALWAYS_CHECKED, problems)
    known = dict.fromkeys((*ALWAYS_CHECKED, *map(check_name, scenario.checks)))
    for case, rule in scenario.cases.items():
        for i, name in enumerate(rule.expected_failures):
            problems.unknown(f"case.{case}.expected_failures[{i}]", "check", name, known)
    _check_laws(scenario, problems)
    _check_graphs(scenario, feeder, problems)


def _check_named(
    field: str, keys: Sequence[PluginKey], registry: Registry[Any], always: Collection[str], problems: Problems
) -> None:
    names: list[str] = []
    for i, key in enumerate(keys):
        path, table = f"{field}[{i}]", table_of(key)
        label, off = table.pop("name", ""), table.pop("off", False) if registry is CHECKS else False
        if not isinstance(label, str) or (label and not good_name(label)):
            where = "the verdict is up to 41 letters, digits and _: calm_at_night"
            where = where if registry is CHECKS else "tables is up to 41 letters, digits and _, the unit last: f_min_Hz"
            problems.add(f"{path}.name", f"a name in {where}")
            continue
        if not isinstance(off, bool):
            problems.add(f"{path}.off", "must be true or false; true removes the check from the verdict")
        plugin = _check(path, key if isinstance(key, str) else table, registry, problems)
        if plugin is None:
            continue
        kind, name = registry.kind, name_of(plugin, label)
        if name in always and plugin.use != name:
            text = f'every run has a {kind} "{name}" already; give this one a name: {{ name = "my_{name}" }}'
            problems.add(path, text)
        elif name in names:
            problems.add(path, f'there is a {kind} "{name}" in this list already; give one of them another name')
        elif off is True and name not in always:
            problems.add(f"{path}.off", f'the check "{name}" is off unless a scenario names it; leave this entry out')
        names.append(name)


def _check_laws(scenario: ScenarioModel, problems: Problems) -> None:
    _check_law("law", scenario.law, problems)
    for name, case in scenario.cases.items():
        path = f"case.{name}.law"
        if case.law != "":  # an empty table is no law, and not the scenario's either
            _check_law(path, case.law, problems)
        if problems.touch(path, "law"):
            continue
        law = law_of(scenario, name)
        if law.name != PAPER and case.gains not in (scenario.gains, Gains()):
            text = f'[gains] belong to the law "{PAPER}", and this case has {law.name}; write them into [{path}]'
            problems.add(f"case.{name}.gains", text)
        if law.name != PAPER and case.degraded_communication.weights != "paper":
            text = (
                f'weights other than "paper" belong to the law "{PAPER}", and this case has {law.name}; leave them out'
            )
            problems.add(f"case.{name}.degraded_communication.weights", text)


def _check_graphs(scenario: ScenarioModel, feeder: Tables | None, problems: Problems) -> None:
    for name, case in scenario.cases.items():
        path = f"case.{name}.graph"
        if problems.touch(path):
            continue
        plugin = _check(path, case.graph, GRAPHS, problems)
        if plugin is None or plugin.use in OUR_GRAPHS or feeder is None:
            continue
        try:
            rule = make_graph(plugin)
            for roster in _rosters(scenario, feeder, name):
                check_graph(rule, roster, plugin.use)
        except ValueError as error:  # a `GraphError`, or a `PluginError` of one that cannot be called
            problems.add(path, str(error))


def check_portable(scenario: ScenarioModel, *, measures: bool = False) -> list[str]:
    """Return a sentence for all that no other process could import; with `measures`, the processes measure too."""
    found = []
    for name, case in scenario.cases.items():
        used: list[tuple[Registry[Any], str]] = [(LAWS, law_of(scenario, name).use), (GRAPHS, graph_of(case)[0])]
        used += [(FAULTS, it.use) for fault in (*scenario.netem.links, *case.netem.links) for it in fault.own]
        used += [(METRICS, metric.use) for _, metric in metrics_of(scenario) if measures]
        plant = scenario.plant
        models = (plant.gfm.model, plant.gfl.model, *(given(it.own).get("model", "") for it in plant.inverter.values()))
        used += [(INVERTERS, model) for model in models if model]
        for registry, use in used:
            try:
                registry.portable(use)
            except PluginError as error:
                found.append(f"case {name}: {error}")
    return list(dict.fromkeys(found))


def _check_law(path: str, key: PluginKey, problems: Problems) -> None:
    if not problems.touch(path):
        for place, text in law_problems(table_of(key)):
            problems.add(f"{path}.{place}" if place and isinstance(key, Mapping) else path, text)


def _check(path: str, key: PluginKey, registry: Registry[Any], problems: Problems) -> Plugin | None:
    table = table_of(key)
    names = [(name, table.get(name, "")) for name in ("use", "folder")]
    found = [(name, "must be a text in quotes") for name, value in names if not isinstance(value, str)]
    found = found or [(name, "cannot be the name of a module or folder") for name, value in names if is_no_path(value)]
    if not found and not table.get("use"):
        found.append(("", f'names no {registry.kind}; write e.g. {{ use = "mine:Name" }}'))
    found = found or [(name, text) for name, value in table.items() if (text := scalar_objection(value))]
    plugin = None if found else plugin_of(table)
    for name, text in found or plugin_problems(registry, plugin_of(table)):
        problems.add(f"{path}.{name}" if name and isinstance(key, Mapping) else path, text)
        plugin = None
    return plugin


def _rosters(scenario: ScenarioModel, feeder: Tables, case: str) -> Iterator[dict[str, InverterRow]]:
    rows = with_agent(scenario, feeder, case)
    present = {row.name for row in rows if not row.spare}
    yield {row.name: row for row in rows if row.name in present}
    for event in scenario.events:
        if event.leave or event.join:
            present = (present - set(event.leave)) | set(event.join)
            yield {row.name: row for row in rows if row.name in present}
