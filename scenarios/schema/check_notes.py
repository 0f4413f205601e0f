"""Whether the plant of a scenario without problems has a state to start from, as `gridpeers check` tries it."""

from __future__ import annotations

from gridpeers.plant.build import plant_at_rest
from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import Tables
from gridpeers.plant.simulators import SIMULATORS
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.scenario_model import ScenarioModel


def start_problem(scenario: ScenarioModel, feeder: Tables) -> str:
    """Return why the plant has no operating point at t = 0, or cannot operate an event's switches; "" if it can."""
    if SIMULATORS.resolve(scenario.plant.simulator).elsewhere:  # it finds its own
        return ""
    plant, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    try:
        plant_at_rest(plant)
    except (PlantError, ValueError) as error:
        return str(error)
    return ""
