"""Find a plant that does not come to rest after its last event on droop alone: no secondary law can help there."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np

from gridpeers.plant.build import build_plant
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.feeder.limit_events import LIMITS
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.messages import OFF

SETTLE = 1.2
"""Time (s) given to the transient after the last event; the swings after it are judged."""

WINDOW = 0.4
"""Length (s) of each of the two windows that are compared: an oscillation of 3 Hz or more is there with a period."""

SWING = 0.02
"""Swing of a frequency (Hz) that is at rest."""

FIRST = 0.1
"""Time (s) to which the first event is moved: until then nothing happens."""


class Unrest(NamedTuple):
    """What keeps a plant from coming to rest."""

    text: str
    """"its frequencies swing by 0.35 Hz, and do not calm down", or what tripped, after which limit of a current."""
    limited: bool
    """Whether grid-forming inverters were at their current limit."""


def unsteady(scenario: ScenarioModel, feeder: Feeder, case: str) -> Unrest | None:
    """Return what goes on after the last event on droop alone; None if the plant comes to rest.

    Parameters
    ----------
    scenario : ScenarioModel
        A checked scenario whose plant can start; its events are made to come early.
    feeder : Feeder
        Its feeder.
    case : str
        The case whose events are taken.
    """
    config, _ = configs(scenario, feeder, case)
    settings = config.settings
    early = FIRST - min(_times(settings), default=FIRST)
    events = tuple(msgspec.structs.replace(event, t=round(event.t + early, 9)) for event in settings.events)
    loads = tuple(msgspec.structs.replace(event, t=round(event.t + early, 9)) for event in settings.loads)
    settings = msgspec.structs.replace(settings, events=events, loads=loads)
    plant = build_plant(msgspec.structs.replace(config, settings=settings))
    forming = [row.name for row in feeder.inverters if row.kind == "GFM"]
    last = max(_times(settings), default=FIRST)
    end, window = round((last + SETTLE) / config.T_c), round(WINDOW / config.T_c)
    found: list[list[float]] = []
    for _ in range(end):
        plant.advance()
        readings = plant.measure()
        found.append([readings[name].f if readings[name].island != OFF else np.nan for name in forming])
    happened = plant.take_events()
    limits = [event.text for event in happened if LIMITS in event.text][:1]
    trip = next((event.text for event in happened if event.kind == "trip"), "")
    if trip:
        return Unrest(", and ".join([*limits, trip]), bool(limits))
    f = np.array(found)
    before, after = (float(np.ptp(part, axis=0).max()) for part in (f[-2 * window : -window], f[-window:]))
    if after < SWING or after < 0.5 * before:
        return None
    return Unrest(f"its frequencies swing by {after:.2g} Hz, and do not calm down", bool(limits))


def _times(settings: PlantSettings) -> list[float]:
    """Return when (s) switches are operated and loads change."""
    return [*(event.t for event in settings.events), *(event.t for event in settings.loads)]
