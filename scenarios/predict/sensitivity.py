"""How vars and voltages of the plant answer to V_set, found by moving one V_set after the other on droop alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from plant.build import build_plant
from plant.dynamics import PlantError
from plant.equipment import Feeder
from plant.feeder import Plant, raise_for_trip
from plant.plant_config import PlantConfig
from scenarios.predict.load_steps import LoadError
from scenarios.results.history import Floats
from scenarios.spec import Scenario
from scenarios.spec.configs import configs

STEP = 0.002
"""By how much a V_set is moved (pu): far above rounding, far below where loads and droops bend."""

REST = 2.0
"""Time given to the plant to come to rest (s); on droop alone its slowest part has a time constant of 0.1 s."""


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """How q and v of each inverter (row) answer to V_set of each (column), pu of own rating and nominal voltage."""

    names: tuple[str, ...]
    """Order of rows and columns."""
    S: Floats
    """dq / dV_set (pu per pu)."""
    H: Floats
    """dv / dV_set (pu per pu)."""


def sensitivity(scenario: Scenario, feeder: Feeder) -> Sensitivity:
    """Sensitivities of the plant on droop alone at the end of the first event's window.

    Raises
    ------
    LoadError
        If the plant has no solution there.
    """
    config, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    rated = {row.name: row.P_rated for row in feeder.inverters}
    nominal = {row.name: row.V_nom for row in feeder.inverters}
    names = tuple(row.name for row in feeder.inverters)
    try:
        plant = plant_in_first_window(scenario, config)
        columns = []
        for name in names:
            here = plant.measure()[name]
            sides = []
            for sign in (1.0, -1.0):
                plant.hold(name, here.P_set, here.V_set + sign * STEP * nominal[name])
                _rest(plant, round(REST / config.T_c))
                read = plant.measure()
                sides.append([[read[of].Q / rated[of], read[of].V / nominal[of]] for of in names])
            plant.hold(name, here.P_set, here.V_set)
            columns.append((np.array(sides[0]) - np.array(sides[1])) / (2.0 * STEP))
    except PlantError as error:
        raise LoadError(f"on droop alone: {error}") from error
    return Sensitivity(names=names, S=np.array(columns)[:, :, 0].T, H=np.array(columns)[:, :, 1].T)


def plant_in_first_window(scenario: Scenario, config: PlantConfig) -> Plant:
    """The plant on droop alone, gone on to the last tick before the second event, or to the end of the run.

    Raises
    ------
    PlantError
        If it has no solution on the way.
    """
    end = scenario.events[1].t_s if len(scenario.events) > 1 else scenario.time.end_s
    plant = build_plant(config)
    _rest(plant, math.floor(end / config.T_c + 1e-9) - plant.tick)
    return plant


def _rest(plant: Plant, ticks: int) -> None:
    for _ in range(ticks):
        plant.advance()
    raise_for_trip(plant.take_events())
