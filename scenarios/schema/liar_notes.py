"""Sentences on the agents of a scenario that lie, for `gridpeers check`."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from gridpeers.netem.models.lie import lie_in_words
from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.schema.absences import AgentEvent, why_away
from gridpeers.scenarios.schema.netem_tables import netem_of
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_model import ScenarioModel


def liar_notes(scenario: ScenarioModel, feeder: Feeder) -> Iterator[str]:
    """Yield a sentence for each agent that lies, with the cases in which it does, and why it cannot if it is away."""
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
