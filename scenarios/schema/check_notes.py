"""Notes of `gridpeers check` on a scenario without problems: agents that lie, certificates, and the plant at t = 0."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from math import inf
from typing import NamedTuple

from gridpeers.netem.models.lie import lie_in_words
from gridpeers.plant.build import plant_at_rest
from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.simulators import SIMULATORS
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import inverters_of, netem_of, without_agent
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.driver.command_line import command_line


class AgentEvent(NamedTuple):
    t_s: float
    """Run time (s)."""
    leave: Collection[str]
    join: Collection[str]


def why_away(name: str, begin_s: float, end_s: float, events: Iterable[AgentEvent], *, at_start: bool) -> str:
    """Return why an agent is away all the time between two run times (s), "" if it is there at any.

    The events are in the order of time; the end may be infinite. An agent that is killed has no other fault from then
    on.
    """
    for begin, end, why in _absences(name, events, at_start=at_start):
        if begin <= begin_s and end_s <= end:
            return why
    return ""


def _absences(name: str, events: Iterable[AgentEvent], *, at_start: bool) -> Iterator[tuple[float, float, str]]:
    away, why = (inf, "") if at_start else (0.0, "has not joined")
    for event in events:
        if name in event.leave:
            away, why = event.t_s, f"has left at {event.t_s:g} s"
        elif name in event.join and away < inf:
            yield away, event.t_s, why
            away = inf
    if away < inf:
        yield away, inf, why


def liar_notes(scenario: ScenarioModel, feeder: Feeder) -> Iterator[str]:
    """Yield a sentence for each agent that lies, with the cases in which it does."""
    there = {row.name for row in inverters_of(scenario, feeder) if not row.spare}
    events = [AgentEvent(event.t_s, event.leave, event.join) for event in scenario.events]
    cases: dict[str, list[str]] = {}
    for case in scenario.cases:
        for node in netem_of(scenario, case).nodes:
            if node.lies is not None:
                end = "the end" if node.to_s is None else f"{node.to_s:g} s"
                text = f"{node.name} lies from {node.from_s:g} s to {end}: {lie_in_words(node.lies)}"
                until = inf if node.to_s is None else node.to_s
                if why := why_away(node.name, node.from_s, until, events, at_start=node.name in there):
                    text += f"; nobody hears it, as {node.name} {why}"
                cases.setdefault(text, []).append(case)
    for text, of in cases.items():
        yield text + ("" if len(of) == len(scenario.cases) else f" (in {', '.join(of)})")


def security_notes(scenario: ScenarioModel, feeder: Feeder, file: str) -> Iterator[str]:
    """Yield how to run a scenario with `security = "mtls"`, which the command line named as `file`."""
    if scenario.security != "mtls":
        return
    lone = frozenset.intersection(*(without_agent(scenario, case) for case in scenario.cases))
    agents = [row.name for row in inverters_of(scenario, feeder) if row.name not in lone]
    yield (
        f'security = "mtls": processes need certificates: {command_line("keys", "init", "lab")}, then '
        f"{command_line('keys', 'issue', *agents, '--keys', 'lab')}, then "
        f"{command_line('run', file, '--keys', 'lab')} (docs/security.md); --driver inprocess needs none"
    )


def start_problem(scenario: ScenarioModel, feeder: Feeder) -> str:
    """Return why the plant has no operating point at t = 0, or cannot operate an event's switches; "" if it can."""
    if SIMULATORS.resolve(scenario.plant.simulator).elsewhere:  # it finds its own
        return ""
    plant, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    try:
        plant_at_rest(plant)
    except (PlantError, ValueError) as error:
        return str(error)
    return ""
