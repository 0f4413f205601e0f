"""Inverters without an agent, and those that run the secondary law: their problems, and who has an agent."""

from __future__ import annotations

from collections.abc import Sequence

from plant.equipment import Feeder, InverterRow
from scenarios.schema.agent_schedule import inverters_of
from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import Scenario
from wire.suggestion import suggestion


def without_agent(scenario: Scenario, case: str) -> frozenset[str]:
    """Names of the inverters that have no agent in a case: those of the whole scenario and the case's own."""
    return frozenset((*scenario.without_agent, *scenario.cases[case].without_agent))


def with_agent(scenario: Scenario, feeder: Feeder, case: str) -> tuple[InverterRow, ...]:
    """Inverters that have an agent in a case, those that join later last, in the table's order.

    Examples
    --------
    >>> from scenarios.schema import load_scenario
    >>> len(with_agent(*load_scenario("islanding"), "IV"))
    9
    """
    without = without_agent(scenario, case)
    return tuple(row for row in inverters_of(scenario, feeder) if row.name not in without)


def check_agentless(scenario: Scenario, feeder: Feeder, problems: Problems) -> None:
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
                problems.add(where, f"an entry [[node]] befalls the agent of {node.name}, so it must have one")
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
        if name not in known:
            problems.add(path, f'no inverter "{name}"; {suggestion(name, known, "inverters")}')
        elif name in given[:i]:
            problems.add(path, f'"{name}" is named twice; name it once')
