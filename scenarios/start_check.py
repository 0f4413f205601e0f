"""The operating point of a checked scenario at t = 0: the last check of `gridpeers check`."""

from __future__ import annotations

from gridpeers.plant.build import plant_at_rest
from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.configs import configs


def start_problem(scenario: ScenarioModel, feeder: Feeder) -> str:
    """Return why the plant has no operating point at t = 0, or cannot operate an event's switches; "" if it can.

    All cases start from the same one, GridLAB-D too. Another simulator finds its own.
    """
    if scenario.plant.simulator not in ("gridpeers", "gridlabd"):
        return ""
    plant, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    try:
        plant_at_rest(plant)
    except (PlantError, ValueError) as error:
        return str(error)
    return ""
