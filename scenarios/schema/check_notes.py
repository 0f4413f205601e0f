"""Notes of `gridpeers check` on a scenario without problems: agents that lie, and the plant at t = 0."""

from __future__ import annotations

from collections.abc import Iterator

from gridpeers.netem.models.lie import lie_in_words
from gridpeers.plant.build import plant_at_rest
from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.simulators import SIMULATORS
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import netem_of
from gridpeers.scenarios.schema.scenario_model import ScenarioModel


def liar_notes(scenario: ScenarioModel, _: Feeder) -> Iterator[str]:
    """Yield a sentence for each agent that lies, with the cases in which it does."""
    cases: dict[str, list[str]] = {}
    for case in scenario.cases:
        for node in netem_of(scenario, case).nodes:
            if node.lies is not None:
                end = "the end" if node.to_s is None else f"{node.to_s:g} s"
                text = f"{node.name} lies from {node.from_s:g} s to {end}: {lie_in_words(node.lies)}"
                cases.setdefault(text, []).append(case)
    for text, of in cases.items():
        yield text + ("" if len(of) == len(scenario.cases) else f" (in {', '.join(of)})")


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
