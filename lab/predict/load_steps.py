"""The load of each island before and after an event, from the scenario's own plant on droop alone.

Without agents and messages the plant runs through the events once (a second or so). At the end of each window its
inverters deliver the load that control has to share. It is the load at the voltages of droop, a percent or two off the
load at restored voltages.
"""

from __future__ import annotations

from dataclasses import dataclass

from gridpeers.lab.predict.times import LoadStep
from gridpeers.plant.build import build_plant
from gridpeers.plant.dynamics import PlantError
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.feeder import GRID, Plant, raise_for_trip
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import inverters_of


@dataclass(frozen=True, kw_only=True)
class IslandStep:
    label: str
    t_s: float
    roster: tuple[str, ...]
    members: tuple[str, ...]
    load: LoadStep | None


class LoadError(RuntimeError):
    """The plant has no solution on droop alone; the message says where."""


def load_steps(scenario: ScenarioModel, feeder: Feeder) -> tuple[IslandStep, ...]:
    """Return the islands without the grid after each event, and their steps of load."""
    config, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    rating = {row.name: row.P_rated for row in inverters_of(scenario, feeder)}
    try:
        return _through(scenario, config, rating)
    except PlantError as error:
        raise LoadError(f"on droop alone: {error}") from error


def _through(scenario: ScenarioModel, config: PlantConfig, rating: dict[str, float]) -> tuple[IslandStep, ...]:
    plant, T = build_plant(config), scenario.time.T_c_s
    on = set(plant.inverters) - set(config.settings.spares)
    ends = [event.t_s for event in scenario.events[1:]] + [scenario.time.end_s]
    before, found = _carried(plant, rating, on), []
    for event, end in zip(scenario.events, ends, strict=True):
        while (plant.tick + 1) * T <= end + 1e-9:
            if plant.tick == round(event.t_s / T):
                for name in (*event.leave, *event.join):
                    plant.connect(name, name in event.join)
                on = (on - set(event.leave)) | set(event.join)
            plant.advance()
        raise_for_trip(plant.take_events())
        after = _carried(plant, rating, on)
        roster = tuple(name for name in plant.inverters if name in on)
        for members, (load, connected) in after.items():
            if connected:
                continue
            former = [names for names in before if set(members) & set(names)]
            step = None
            if len(former) == 1:
                start, fed = before[former[0]]
                new = fed or former[0][0] != members[0]  # an island is known by its first inverter
                step = LoadStep(start_pu=start, load_pu=load, islanding=new, joining=event.join)
            found.append(IslandStep(label=event.label, t_s=event.t_s, roster=roster, members=members, load=step))
        before = after
    return tuple(found)


def _carried(plant: Plant, rating: dict[str, float], on: set[str]) -> dict[tuple[str, ...], tuple[float, bool]]:
    islands: dict[str, dict[str, float]] = {}
    for name, reading in plant.measure().items():
        if name in on:
            islands.setdefault(reading.island, {})[name] = reading.P
    return {
        tuple(P): (sum(P.values()) / sum(rating[name] for name in P), island == GRID) for island, P in islands.items()
    }
