"""The plant of a HELICS federation: a foreign federate simulates it, and agents of gridpeers control it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import msgspec

from gridpeers.bridges.helics.federate import (
    HELD,
    SENSORS,
    SET_POINTS,
    WHERE,
    HelicsError,
    HelicsFederate,
    Topic,
    Value,
    events,
    number,
    topics,
)
from gridpeers.bridges.helics.helics_simulator import settings_of
from gridpeers.plant.equipment import Tables
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import Reading, RecordedPlant
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.messages import NAME, PlantEvent
from gridpeers.wire.timing import time_of
from gridpeers.wire.wording import first_of

SHOWN = 4  # topics that an error names


class HelicsPlant(RecordedPlant):
    """The plant for the agents, and a controller in the federation.

    For record time t it asks for t + `ACT` and reads the values published until t; at a tick it then publishes the
    set-points of the agents. A plant that reads set-points at the end of its step therefore has them in force from t.
    The federate connects first, because other federates stop trying while a plant is compiled.
    """

    def __init__(self, config: PlantConfig, feeder: Tables) -> None:
        settings, helics = config.settings, settings_of(config.settings)
        self.tick = 0
        self._T_c, self._record = config.T_c, config.record_step
        self._end_tick = None if config.end is None else round(config.end / config.T_c)
        self._prefix, self._events_key = helics.prefix, events(helics.prefix).key
        self._outgoing: dict[str, Value] = {}  # values to publish with the next step
        self._federate = HelicsFederate(helics, config.deadline)
        self.inverters = tuple(row.name for row in feeder.inverters)
        self._rows_a_tick = round(config.T_c / config.record_step)
        self._row_keys = self._keys(self.inverters, SENSORS, HELD)
        self._needed = self._keys(self.inverters, SENSORS)
        self._values: dict[str, Value] = {}
        self._came: set[str] = set()  # topics that the foreign plant has published
        for row in feeder.inverters:  # until the plant publishes others
            self._hold(row.name, settings.P_set0 * row.P_rated, settings.V_set0 * row.V_nom)
        self._rows: list[tuple[float, ...]] = []
        self._events: list[PlantEvent] = []
        try:
            asked = topics(self._prefix, self.inverters, SENSORS)
            asked += [*topics(self._prefix, self.inverters, HELD, WHERE), events(self._prefix)]
            federation = self._federate.begin(topics(self._prefix, config.agents, SET_POINTS), asked)
            if lacking := [key for key in self._needed if key in federation["missing"]]:
                raise HelicsError(
                    f"HELICS: nobody publishes {first_of(lacking, SHOWN)} ({_others(federation)}); "
                    "publish these topics, or correct plant.helics.prefix"
                )
            self._hear(0)
        except HelicsError as error:
            self._federate.abort(str(error))
            raise

    def measure(self) -> dict[str, Reading]:
        readings = {}
        for name in self.inverters:
            f, P, Q, V, P_set, V_set = (float(self._values[key]) for key in self._keys([name], SENSORS, HELD))
            fed = bool(self._values.get(f"{self._prefix}/{name}/grid_connected", False))
            island = str(self._values.get(f"{self._prefix}/{name}/island", "grid" if fed else self.inverters[0]))
            readings[name] = Reading(P, Q, V, f, P_set, V_set, fed, island)
        return readings

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Publish set-points (W, V) with the next step; one that is not finite is ignored."""
        if math.isfinite(P_set) and math.isfinite(V_set):
            self._hold(name, P_set, V_set)
            self._outgoing |= dict(zip(self._keys([name], SET_POINTS), (P_set, V_set), strict=True))

    def connect(self, name: str, on: bool) -> None:
        raise HelicsError(f"{name} cannot {'join' if on else 'leave'}: a HELICS plant has its inverters all the time")

    def advance(self) -> None:
        try:
            for k in range(1, self._rows_a_tick + 1):
                self._hear(self.tick * self._rows_a_tick + k)
        except HelicsError as error:
            self._federate.abort(str(error))
            raise
        self.tick += 1

    def close(self) -> None:
        if self.tick == self._end_tick:
            self._federate.end()
        else:
            self._federate.abort(f"the run ended at t = {time_of(self.tick, self._T_c):g} s, before its end")

    def _keys(self, inverters: Iterable[str], *groups: Sequence[Topic]) -> list[str]:
        return [topic.key for topic in topics(self._prefix, inverters, *groups)]

    def _hold(self, name: str, *set_points: float) -> None:
        held = zip(self._keys([name], HELD), set_points, strict=True)
        self._values |= {key: value for key, value in held if key not in self._came}

    def _hear(self, row: int) -> None:
        t = time_of(row, self._record)
        came = self._federate.step(self._outgoing, t)
        self._outgoing = {}
        for key, value in came.items():
            if not isinstance(value, bool | str) and not math.isfinite(number(value)):
                raise HelicsError(f"HELICS, t = {t:g} s: {key} is not a finite number; correct its publisher")
            if key.endswith("/island") and not re.fullmatch(NAME, str(value)):
                text = f"{key} must be the name of an inverter, grid or off, got {str(value)!r:.80}"
                raise HelicsError(f"HELICS, t = {t:g} s: {text}; correct its publisher")
        self._values |= came
        self._came |= came.keys()
        if lacking := [key for key in self._needed if key not in self._values]:
            names = first_of(lacking, SHOWN)
            raise HelicsError(f"HELICS, t = {t:g} s: no value yet of {names}; publish all at t = 0 or before")
        self._rows.append((t, *(float(self._values[key]) for key in self._row_keys)))
        if text := str(came.get(self._events_key, "")):
            try:
                self._events += decode_foreign(msgspec.json.Decoder(tuple[PlantEvent, ...]).decode, text)
            except msgspec.DecodeError as error:
                told = f"{self._events_key} cannot be read: {error}"
                self._events.append(PlantEvent(t=t, kind="warning", subject=self._events_key, text=told))


def _others(federation: Mapping[str, list[str]]) -> str:
    return f"in the federation: {', '.join(federation['others']) or 'nobody else'}"
