"""Whether a checked scenario has an operating point to start from: the last thing that `gridpeers check` finds out."""

from __future__ import annotations

from plant.build import build_plant
from plant.dynamics import PlantError
from plant.equipment import Feeder
from scenarios.schema import ScenarioModel
from scenarios.schema.configs import configs


def start_problem(scenario: ScenarioModel, feeder: Feeder) -> str:
    """Why the plant has no operating point at t = 0, or cannot have its switches as an event wants them; "" if it has.

    All cases start from the same one, GridLAB-D too. Another simulator finds its own.
    """
    if scenario.plant.simulator not in ("gridpeers", "gridlabd"):
        return ""
    plant, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    try:
        build_plant(plant)
    except (PlantError, ValueError) as error:
        return str(error)
    return ""
