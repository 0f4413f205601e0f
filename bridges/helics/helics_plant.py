"""Plants in a HELICS federation: one that an outside federate simulates, and ours, with controllers outside."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise

import msgspec

from gridpeers.bridges.helics.federate import (
    ACT,
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
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike, Reading, RecordedPlant, SimulatedPlant
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.messages import NAME, PlantEvent
from gridpeers.wire.timing import time_of
from gridpeers.wire.wording import first_of

SHOWN = 4  # topics that an error names


class FederatePlant(SimulatedPlant, RecordedPlant):
    """A plant with a federate, which it gets before all else: others give up to connect while a plant is compiled."""

    def __init__(self, config: PlantConfig) -> None:
        helics = settings_of(config.settings)
        self.tick = 0
        self._T_c, self._record = config.T_c, config.record_step
        self._end_tick = None if config.end is None else round(config.end / config.T_c)
        self._prefix, self._events_key = helics.prefix, events(helics.prefix).key
        self._outgoing: dict[str, Value] = {}  # values to publish with the next step
        self._federate = HelicsFederate(helics, config.deadline)

    def close(self) -> None:
        if self.tick == self._end_tick:
            self._federate.end(self._outgoing)
        else:
            self._federate.abort(f"the run ended at t = {time_of(self.tick, self._T_c):g} s, before its end")

    def _keys(self, inverters: Iterable[str], *groups: Sequence[Topic]) -> list[str]:
        return [topic.key for topic in topics(self._prefix, inverters, *groups)]


class HelicsPlant(FederatePlant):
    """The plant's side of our agents, and a controller in the federation.

    At record time t it asks for t + `ACT` and reads what was published until t; at a tick it publishes there the
    agents' set-points. So a plant that steps from t on with what it finds at the end of its step has them in force from
    t, as ours has.
    """

    def __init__(self, config: PlantConfig, feeder: Feeder) -> None:
        super().__init__(config)
        settings = config.settings
        self.inverters = tuple(row.name for row in feeder.inverters)
        self._rows_a_tick = round(config.T_c / config.record_step)
        self._row_keys = self._keys(self.inverters, SENSORS, HELD)
        self._needed = self._keys(self.inverters, SENSORS)
        self._values: dict[str, Value] = {}
        self._came: set[str] = set()  # topics that the outside plant has published
        for row in feeder.inverters:  # held until somebody says otherwise
            self._hold(row.name, settings.P_set0 * row.P_rated, settings.V_set0 * row.V_nom)
        self._rows: list[tuple[float, ...]] = []
        self._events: list[PlantEvent] = []
        try:
            asked = topics(self._prefix, self.inverters, SENSORS)
            asked += [*topics(self._prefix, self.inverters, HELD, WHERE), events(self._prefix)]
            federation = self._federate.begin(topics(self._prefix, config.agents, SET_POINTS), asked, {})
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
        self._outgoing = {}  # set-points of a time that does not come
        super().close()

    def _hold(self, name: str, *set_points: float) -> None:
        """Keep the set-points that an inverter was given as those that it follows."""
        held = zip(self._keys([name], HELD), set_points, strict=True)
        self._values |= {key: value for key, value in held if key not in self._came}

    def _hear(self, row: int) -> None:
        t = time_of(row, self._record)
        came = self._federate.step(self._outgoing, t, ACT)
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


class BridgedPlant(FederatePlant):
    """A plant whose inverters without an agent of ours follow set-points of outside federates.

    At each record time t it publishes what it has at t. It asks for the first record time after a tick before it
    computes that tick: so set-points that are published between are in force from the tick on, as an agent's are.
    """

    def __init__(self, build: Callable[[], PlantLike], config: PlantConfig) -> None:
        super().__init__(config)
        try:
            plant = self._plant = build()
        except BaseException as error:
            self._federate.abort(f"its plant cannot start: {error}")
            raise
        self.inverters = plant.inverters
        outside = [name for name in plant.inverters if name not in config.agents]
        readings = plant.measure()
        self._held = {name: (readings[name].P_set, readings[name].V_set) for name in outside}
        """Set-points of the inverters that outside federates control."""
        self._rows, self._events = list(plant.take_rows()), list(plant.take_events())
        self._row_keys = self._keys(plant.inverters, SENSORS, HELD)
        self._where_keys = self._keys(plant.inverters, WHERE)
        self._where: dict[str, Value] = {}  # flags and names that were published last: they go out when they change
        try:
            asked = topics(self._prefix, outside, SET_POINTS)
            own = [*topics(self._prefix, plant.inverters, SENSORS, HELD), *topics(self._prefix, plant.inverters, WHERE)]
            federation = self._federate.begin([*own, events(self._prefix)], asked, self._values(self._events))
            self._note_absent(federation)
        except HelicsError as error:
            self._federate.abort(str(error))
            plant.close()
            raise

    def measure(self) -> Mapping[str, Reading]:
        return self._plant.measure()

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        self._plant.hold(name, P_set, V_set)

    def connect(self, name: str, on: bool) -> None:
        self._plant.connect(name, on)

    def advance(self) -> None:
        first = time_of(self.tick * round(self._T_c / self._record) + 1, self._record)
        self._take(self._federate.step(self._outgoing, first, needed=bool(self._held)))
        for name, (P_set, V_set) in self._held.items():
            self._plant.hold(name, P_set, V_set)
        self._plant.advance()
        self.tick += 1
        rows, happened = self._plant.take_rows(), self._plant.take_events()
        self._rows += rows
        self._events += happened
        for row, following in pairwise(rows):
            values = dict(zip(self._row_keys, row[1:], strict=True))
            self._take(self._federate.step(values, following[0], needed=False))
        self._outgoing = self._values(happened)

    def close(self) -> None:
        super().close()
        self._plant.close()

    def _take(self, came: Mapping[str, Value]) -> None:
        for name, held in self._held.items():
            keys = self._keys([name], SET_POINTS)
            P_set, V_set = (number(came.get(key, own)) for key, own in zip(keys, held, strict=True))
            self._held[name] = P_set, V_set

    def _values(self, happened: Sequence[PlantEvent]) -> dict[str, Value]:
        """Return readings and events as values; flags, names and events only where there is something new."""
        readings = self._plant.measure().values()
        numbers = [float(x) for r in readings for x in (r.f, r.P, r.Q, r.V, r.P_set, r.V_set)]
        before = self._where
        flags: list[Value] = [x for r in readings for x in (r.grid_connected, r.island)]
        self._where = dict(zip(self._where_keys, flags, strict=True))
        changed = {key: value for key, value in self._where.items() if before.get(key) != value}
        told = {self._events_key: msgspec.json.encode(tuple(happened)).decode()} if happened else {}
        return {**dict(zip(self._row_keys, numbers, strict=True)), **changed, **told}

    def _note_absent(self, federation: Mapping[str, list[str]]) -> None:
        asked = {name: self._keys([name], SET_POINTS) for name in self._held}
        absent = [name for name, keys in asked.items() if set(keys) <= set(federation["missing"])]
        if absent and len(absent) == len(asked):
            raise HelicsError(
                f"HELICS: nobody publishes {min(asked.values())[0]} or another set-point ({_others(federation)}); "
                "publish one, or let agents of ours control: --outside none"
            )
        for name in absent:
            text = f"nobody publishes set-points of {name}: it stays on primary droop at its first ones"
            self._events.append(PlantEvent(t=0.0, kind="warning", subject=name, text=text))


def _others(federation: Mapping[str, list[str]]) -> str:
    return f"in the federation: {', '.join(federation['others']) or 'nobody else'}"
