"""The participants of a run: its inverters, which of them have an agent, and when agents leave and join."""

from __future__ import annotations

from collections.abc import Sequence

from gridpeers.plant.equipment import Feeder, InverterRow
from gridpeers.plant.helics.helics_settings import settings_problems
from gridpeers.plant.plant_config import ScheduledAction
from gridpeers.scenarios.schema.scenario_errors import Problems, multiple
from gridpeers.scenarios.schema.scenario_model import ScenarioModel


def inverters_of(scenario: ScenarioModel, feeder: Feeder) -> tuple[InverterRow, ...]:
    """Return the inverters of a scenario: the feeder's, and those of its spare ones that join, in the table's order."""
    joining = {name for event in scenario.events for name in event.join}
    return (*feeder.inverters, *(row for row in feeder.spares if row.name in joining))


def schedule_of(scenario: ScenarioModel) -> tuple[ScheduledAction, ...]:
    """Return the agents that leave and join, in the order of time."""
    actions = []
    for event in scenario.events:
        actions += [ScheduledAction(t=event.t_s, inverter=name, action="leave") for name in event.leave]
        actions += [ScheduledAction(t=event.t_s, inverter=name, action="join") for name in event.join]
    return tuple(actions)


def without_agent(scenario: ScenarioModel, case: str) -> frozenset[str]:
    """Return the names of the inverters without an agent in a case: the scenario's and the case's own."""
    return frozenset((*scenario.without_agent, *scenario.cases[case].without_agent))


def with_agent(scenario: ScenarioModel, feeder: Feeder, case: str) -> tuple[InverterRow, ...]:
    """Return the inverters that have an agent in a case, those that join later last, in the table's order."""
    without = without_agent(scenario, case)
    return tuple(row for row in inverters_of(scenario, feeder) if row.name not in without)


def check_schedule(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note agents that leave while absent or join while present, and times that are no ticks."""
    present = {row.name for row in feeder.inverters}
    known = (*(row.name for row in feeder.inverters), *(row.name for row in feeder.spares))
    for i, event in enumerate(scenario.events):
        if event.leave or event.join:
            rule = "the period at which agents leave and join"
            multiple(f"event[{i}].t_s", event.t_s, "time.T_c_s", scenario.time.T_c_s, rule, problems)
        named: set[str] = set()
        for key, names in (("leave", event.leave), ("join", event.join)):
            path = f"event[{i}].{key}"
            for name in names:
                if problems.unknown(path, "inverter", name, known):
                    continue
                if name in named:
                    problems.add(path, f'"{name}" is named twice in event "{event.label}"; name it once')
                elif key == "leave" and name not in present:
                    problems.add(path, f'"{name}" is not there at {event.t_s:g} s; leave it out, or let it join before')
                elif key == "join" and name in present:
                    problems.add(
                        path, f'"{name}" is there already at {event.t_s:g} s; leave it out, or let it leave before'
                    )
                named.add(name)
        present = (present - set(event.leave)) | set(event.join)


def check_simulator(scenario: ScenarioModel, problems: Problems) -> None:
    """Note joins, leaves, loads and methods of time stepping that other simulators lack, and wrong HELICS settings."""
    simulator = scenario.plant.simulator
    if scenario.time.method != "first-order" and simulator != "gridpeers":
        problems.add(
            "time.method",
            f'"{scenario.time.method}" is a method of plant.simulator = "gridpeers"; "{simulator}" has its own time '
            "stepping; leave time.method out",
        )
    for key, problem in settings_problems(scenario.plant.helics).items():
        if not problems.touch(f"plant.helics.{key}"):
            problems.add(f"plant.helics.{key}", problem)
    for i, event in enumerate(scenario.events):
        for key in ("leave", "join"):
            if getattr(event, key) and simulator != "gridpeers":
                problems.add(
                    f"event[{i}].{key}",
                    f'plant.simulator = "{simulator}" lets no inverter leave or join; use simulator = "gridpeers"',
                )
        if event.load and simulator != "gridpeers":
            problems.add(
                f"event[{i}].load",
                f'plant.simulator = "{simulator}" keeps the loads of its own model; use simulator = "gridpeers"',
            )


def check_agentless(scenario: ScenarioModel, feeder: Feeder, problems: Problems) -> None:
    """Note names that there are not, and events and faults that ask for an agent that there is not."""
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
                where, 'no inverter is left that has an agent; leave one, and for droop alone write secondary = "none"'
            )
        for name in sorted(without & moved.keys()):
            problems.add(where, f'event "{moved[name]}" lets the agent of {name} leave or join, so it must have one')
        for node in (*scenario.netem.nodes, *rule.netem.nodes):
            if node.name in without:
                problems.add(where, f"an entry [[node]] is about the agent of {node.name}, so it must have one")
        _check_secondary(f"{path}.secondary", rule.secondary, names, without, problems)


def _check_secondary(
    path: str, secondary: str | tuple[str, ...], names: Sequence[str], without: frozenset[str], problems: Problems
) -> None:
    if isinstance(secondary, str) or problems.touch(path):
        return
    if not secondary:
        problems.add(path, 'names no inverter; write secondary = "none"')
    _check_names(path, secondary, names, problems)
    for name in secondary:
        if name in without:
            problems.add(path, f"{name} has no agent that could run the law; take it out of without_agent, or of here")


def _check_names(path: str, given: Sequence[str], known: Sequence[str], problems: Problems) -> None:
    if problems.touch(path):
        return
    for i, name in enumerate(given):
        if not problems.unknown(path, "inverter", name, known) and name in given[:i]:
            problems.add(path, f'"{name}" is named twice; name it once')
