"""The participants of a run: its inverters, which of them have an agent, and when agents leave and join."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from pathlib import Path

import msgspec

from gridpeers.netem.schema.netem import Netem
from gridpeers.netem.schema.trace_file import with_traces
from gridpeers.plant.equipment import InverterRow, Tables
from gridpeers.plant.equipment.connectivity import SwitchOperations, islands_after
from gridpeers.plant.plant_config import ScheduledAction
from gridpeers.plant.simulators import OURS, SIMULATORS
from gridpeers.scenarios.emulation.link_data import EmulationConfig
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.schema.table_reading import shown
from gridpeers.wire.schema.table_schema import NO_KEY, Problem, fields_of
from gridpeers.wire.wording import suggestion


def inverters_of(scenario: ScenarioModel, feeder: Tables) -> tuple[InverterRow, ...]:
    joining = {name for event in scenario.events for name in event.join}
    return (*feeder.inverters, *(row for row in feeder.spares if row.name in joining))


def schedule_of(scenario: ScenarioModel) -> tuple[ScheduledAction, ...]:
    actions = []
    for event in scenario.events:
        actions += [ScheduledAction(t=event.t_s, inverter=name, action="leave") for name in event.leave]
        actions += [ScheduledAction(t=event.t_s, inverter=name, action="join") for name in event.join]
    return tuple(actions)


def without_agent(scenario: ScenarioModel, case: str) -> frozenset[str]:
    return frozenset((*scenario.without_agent, *scenario.cases[case].without_agent))


def with_agent(scenario: ScenarioModel, feeder: Tables, case: str) -> tuple[InverterRow, ...]:
    """Return the inverters that have an agent in a case, those that join later last."""
    without = without_agent(scenario, case)
    return tuple(row for row in inverters_of(scenario, feeder) if row.name not in without)


def check_simulator(scenario: ScenarioModel, problems: Problems) -> None:
    simulator = scenario.plant.simulator
    if simulator != OURS and simulator not in SIMULATORS.names:
        wrong = f"there is no {shown(simulator)}; {suggestion(simulator, SIMULATORS.names, 'choices')}"
        problems.add("plant.simulator", wrong)
        return
    for name, table in scenario.plant.simulators.items():
        for problem in getattr(table, "relations", list)():
            if not problems.touch(path := f"plant.{name}.{problem.path}"):
                problems.add(path, problem.text)
    if simulator == OURS:
        return
    if scenario.time.method != "first-order":
        problems.add(
            "time.method",
            f'"{scenario.time.method}" is a method of plant.simulator = "gridpeers"; "{simulator}" has its own time '
            "stepping; leave time.method out",
        )
    lacks = {"load": "keeps the loads of its own model"} | dict.fromkeys(
        ("leave", "join"), "lets no inverter leave or join"
    )
    for i, event in enumerate(scenario.events):
        for key, why in lacks.items():
            if getattr(event, key):
                what = f'plant.simulator = "{simulator}" {why}; use simulator = "gridpeers"'
                problems.add(f"event[{i}].{key}", what)


def check_agentless(scenario: ScenarioModel, feeder: Tables, problems: Problems) -> None:
    names = tuple(row.name for row in inverters_of(scenario, feeder))
    _check_names("without_agent", scenario.without_agent, names, problems)
    moved = {name: event.label for event in scenario.events for name in (*event.leave, *event.join)}
    for case, rule in scenario.cases.items():
        path = f"case.{case}"
        _check_names(f"{path}.without_agent", rule.without_agent, names, problems)
        if problems.touch("without_agent", f"{path}.without_agent"):
            continue
        where = f"{path}.without_agent" if rule.without_agent else "without_agent"
        without = without_agent(scenario, case)
        if twice := set(rule.without_agent) & set(scenario.without_agent):
            problems.add(where, f'"{min(twice)}" is named at the top of the file already; name it once')
        if without and without >= {row.name for row in feeder.inverters}:
            problems.add(
                where, 'no inverter has an agent; leave one with an agent, and for droop alone write secondary = "none"'
            )
        for name in sorted(without & moved.keys()):
            problems.add(where, f'event "{moved[name]}" lets the agent of {name} leave or join, so it must have one')
        for node in (*scenario.netem.nodes, *rule.netem.nodes):
            if node.name in without:
                problems.add(where, f"an entry [[node]] names {node.name}, so it must have an agent")
        where = f"{path}.secondary"
        if isinstance(rule.secondary, str) or problems.touch(where):
            continue
        if not rule.secondary:
            problems.add(where, 'names no inverter; write secondary = "none"')
        _check_names(where, rule.secondary, names, problems)
        for name in (name for name in rule.secondary if name in without):
            problems.add(where, f"{name} has no agent to run the law; remove it from without_agent, or from here")


def _check_names(path: str, given: Sequence[str], known: Sequence[str], problems: Problems) -> None:
    if problems.touch(path):
        return
    for i, name in enumerate(given):
        if not problems.unknown(path, "inverter", name, known) and name in given[:i]:
            problems.add(path, f'"{name}" is named twice; name it once')


LISTS = tuple(field for field in fields_of(Netem) if NO_KEY not in field.marks)
"""Fields of the lists of entries: `[[link]]`, `[[partition]]`, `[[node]]`."""

_KEPT_OUT = 'certificates exclude this lie, and the scenario has security = "mtls"; leave one of them out'


def netem_of(scenario: ScenarioModel, case: str) -> Netem:
    """Return the entries of a case, the scenario's first and then its own, with the scenario's seed."""
    tables = scenario.netem, scenario.cases[case].netem
    entries = {list_.name: tuple(it for netem in tables for it in getattr(netem, list_.name)) for list_ in LISTS}
    return Netem(seed=scenario.seed, **entries)


def setup_of(netem: Netem, scenario: ScenarioModel, feeder: Tables, *, real_nodes: bool) -> EmulationConfig:
    """Return a case's faults as the processes take them: islands resolved, as the scenario's switches make them."""
    if any(partition.by == "island" for partition in netem.partitions):
        netem = netem.over(_islands_over_time(scenario, feeder))
    microgrids = {row.name: row.microgrid for row in (*feeder.inverters, *feeder.spares)}
    return EmulationConfig(netem=netem, microgrids=microgrids, real_nodes=real_nodes)


def deaths_of(netem: Netem) -> tuple[ScheduledAction, ...]:
    return tuple(ScheduledAction(t=node.from_s, inverter=node.name, action="die") for node in netem.nodes if node.kill)


def _islands_over_time(scenario: ScenarioModel, feeder: Tables) -> list[tuple[float, dict[str, str]]]:
    times = [0.0, *(event.t_s for event in scenario.events)]
    operations: list[SwitchOperations] = [((), ()), *((event.open, event.close) for event in scenario.events)]
    rows = (*feeder.inverters, *feeder.spares)
    return [
        (t_s, {row.name: next(f"island{i}" for i, island in enumerate(islands) if row.bus in island) for row in rows})
        for t_s, islands in zip(times, islands_after(feeder, operations), strict=True)
    ]


def is_calm(netem: Netem) -> bool:
    return not any(getattr(netem, list_.name) for list_ in LISTS)


def with_delays(scenario: ScenarioModel, folder: Path, problems: Problems) -> ScenarioModel:
    """Return the scenario with the delays of its trace files, whose paths start in its folder."""

    def read(netem: Netem, path: str) -> Netem:
        netem, wrong = with_traces(netem, folder)
        problems.extend(wrong, path)
        return netem

    cases = {
        name: msgspec.structs.replace(case, netem=read(case.netem, f"case.{name}."))
        for name, case in scenario.cases.items()
    }
    return msgspec.structs.replace(scenario, netem=read(scenario.netem, ""), cases=cases)


def check_netem(scenario: ScenarioModel, feeder: Tables | None, problems: Problems) -> None:
    """Note unknown names, values that are not plausible, and contradictory entries; without a feeder all names pass."""
    rows = inverters_of(scenario, feeder) if feeder else ()
    names = tuple(row.name for row in rows) if feeder else None
    microgrids = {row.name: row.microgrid for row in rows}
    T_c = scenario.time.T_c_s
    end_s = inf if problems.touch("time.end_s", "time") else scenario.time.end_s

    def wrong_in(netem: Netem, noted: set[str]) -> list[Problem]:
        nodes = []
        for i, node in enumerate(netem.nodes):
            ticks = node.from_s / T_c
            if node.kill and (ticks < 0.5 or abs(ticks - round(ticks)) > 1e-6):
                text = f"{node.from_s:g} s is not a multiple of T_c_s = {T_c:g} s after 0: agents die at ticks; "
                nodes.append(Problem(f"node[{i}].from_s", f"{text}write {max(1, round(ticks)) * T_c:g}"))
            if node.skew is not None and (node.from_s or node.to_s is not None):
                text = "a clock is skewed for the whole run; leave out from_s and to_s"
                nodes.append(Problem(f"node[{i}].skew", text))
            if scenario.security == "mtls" and node.lies is not None and node.lies.in_name_of:
                nodes.append(Problem(f"node[{i}].lies.in_name_of", _KEPT_OUT))
        return netem.problems(names, microgrids, end_s, noted) + [it for it in nodes if it.path not in noted]

    problems.extend(wrong_in(scenario.netem, _noted("", problems)))
    for name, case in scenario.cases.items():
        path = f"case.{name}."
        problems.extend(wrong_in(case.netem, _noted(path, problems)), path)
        if not (_noted("", problems) or _noted(path, problems) or is_calm(case.netem)):
            for problem in wrong_in(netem_of(scenario, name), set()):
                problems.add(_place(problem.path, scenario.netem, path), problem.text)


def _noted(prefix: str, problems: Problems) -> set[str]:
    entries = tuple(f"{prefix}{list_.key}[" for list_ in LISTS)
    return {path.removeprefix(prefix) for path in problems.paths if path.startswith(entries)}


def _place(path: str, common: Netem, case: str) -> str:
    """Return the path of an entry in the file, given its path among all entries of a case."""
    kind, _, rest = path.partition("[")
    index, _, rest = rest.partition("]")
    before = next(len(getattr(common, list_.name)) for list_ in LISTS if list_.key == kind)
    return f"{case}{kind}[{int(index) - before}]{rest}" if int(index) >= before else path
