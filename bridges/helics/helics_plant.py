"""A plant that an outside federate simulates: its sensors are HELICS values, and our set-points are, too."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise

import msgspec

from gridpeers.bridges.helics import topics
from gridpeers.bridges.helics.federate import HelicsError, HelicsFederate
from gridpeers.bridges.helics.helics_simulator import settings_of
from gridpeers.bridges.helics.topics import ACT, SENSORS, Value, number
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import LivePlant, Reading, RecordedPlant
from gridpeers.wire.bounds import NAME
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.messages import LoadSetting, PlantEvent
from gridpeers.wire.timing import time_of
from gridpeers.wire.wording import first_of

SHOWN = 4
"""Topics that an error names."""


class HelicsPlant(RecordedPlant):
    """The plant's side of our agents, and a controller in the federation.

    At record time t it asks for t + `ACT` and reads what was published until t; at a tick it publishes there the
    agents' set-points. So a plant that steps from t on with what it finds at the end of its step has them in force from
    t, as ours has.
    """

    def __init__(self, config: PlantConfig, feeder: Feeder) -> None:
        settings = config.settings
        helics = self._helics = settings_of(settings)
        self.inverters = tuple(row.name for row in feeder.inverters)
        self.tick = 0
        self._T_c, self._record = config.T_c, config.record_step
        self._rows_a_tick = round(config.T_c / config.record_step)
        self._end_tick = None if config.end is None else round(config.end / config.T_c)
        self._ours = {
            row.name: (settings.P_set0 * row.P_rated, settings.V_set0 * row.V_nom) for row in feeder.inverters
        }
        needed = [topic for name in self.inverters for topic in topics.sensors(helics.prefix, name)]
        optional = [
            topic
            for name in self.inverters
            for topic in (*topics.held(helics.prefix, name), *topics.where(helics.prefix, name))
        ]
        optional.append(topics.events(helics.prefix))
        self._needed = [topic.key for topic in needed]
        self._island_keys = {f"{helics.prefix}/{name}/island" for name in self.inverters}
        self._values: dict[str, Value] = {}
        self._outgoing: dict[str, Value] = {}
        self._rows: list[tuple[float, ...]] = []
        self._events: list[PlantEvent] = []
        ours = [topic for name in config.agents for topic in topics.set_points(helics.prefix, name)]
        self._federate = HelicsFederate(helics, config.deadline)
        try:
            self._check_publishers(self._federate.begin(ours, [*needed, *optional], {}))
            self._hear(0)
        except HelicsError as error:
            self._federate.abort(str(error))
            raise

    def measure(self) -> dict[str, Reading]:
        prefix = self._helics.prefix
        first = self.inverters[0]
        readings = {}
        for name in self.inverters:
            f, P, Q, V, P_set, V_set = self._numbers(name)
            fed = bool(self._values.get(f"{prefix}/{name}/grid_connected", False))
            island = str(self._values.get(f"{prefix}/{name}/island", "grid" if fed else first))
            readings[name] = Reading(P, Q, V, f, P_set, V_set, fed, island)
        return readings

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Publish set-points (W, V) with the next step; one that is not finite is ignored."""
        if not (math.isfinite(P_set) and math.isfinite(V_set)):
            return
        self._ours[name] = P_set, V_set
        for topic, value in zip(topics.set_points(self._helics.prefix, name), (P_set, V_set), strict=True):
            self._outgoing[topic.key] = value

    def connect(self, name: str, on: bool) -> None:
        """Refuse: there is no topic for it."""
        raise HelicsError(f"{name} cannot {'join' if on else 'leave'}: a HELICS plant has its inverters all the time")

    @property
    def switches(self) -> dict[str, bool]:
        """Return none: the outside plant has the switches."""
        return {}

    def switch(self, name: str, action: str, *, synchronised: bool = False) -> bool:
        """Refuse: the outside plant has the switches."""
        raise ValueError(f"{name}: the outside plant has the switches, and HELICS no topic for them")

    @property
    def loads(self) -> Mapping[str, complex]:
        """Return none: the outside plant has the loads."""
        return {}

    def set_load(self, name: str, setting: LoadSetting) -> str:
        """Refuse: the outside plant has the loads."""
        raise ValueError(f"load {name}: the outside plant has the loads, and HELICS no topic for them")

    def advance(self) -> None:
        """Publish the set-points, and go on to the next tick."""
        try:
            for k in range(1, self._rows_a_tick + 1):
                self._hear(self.tick * self._rows_a_tick + k)
        except HelicsError as error:
            self._federate.abort(str(error))
            raise
        self.tick += 1

    def close(self) -> None:
        """Leave the federation, or end it if the run has not reached its end."""
        if self.tick == self._end_tick:
            self._federate.end({})
        else:
            self._federate.abort(f"the run ended at t = {time_of(self.tick, self._T_c):g} s, before its end")

    def _hear(self, row: int) -> None:
        """Publish what is due, go on to a record time, and take its values."""
        t = time_of(row, self._record)
        came = self._federate.step(self._outgoing, t, ACT)
        self._outgoing = {}
        self._check(came, t)
        self._values |= came
        if (lacking := [key for key in self._needed if key not in self._values]) and row == 0:
            names = first_of(lacking, SHOWN)
            raise HelicsError(f"HELICS, t = 0 s: no value yet of {names}; publish all at t = 0 or before")
        self._rows.append((t, *(x for name in self.inverters for x in self._numbers(name))))
        if text := came.get(topics.events(self._helics.prefix).key):
            self._events += self._decoded(str(text), t)

    def _numbers(self, name: str) -> tuple[float, ...]:
        """Return f (Hz), P (W), Q (var), V (V), P_set (W), V_set (V) of an inverter."""
        prefix = self._helics.prefix
        measured = (float(self._values[topic.key]) for topic in topics.sensors(prefix, name))
        followed = zip(topics.held(prefix, name), self._ours[name], strict=True)
        return (*measured, *(float(self._values.get(topic.key, own)) for topic, own in followed))

    def _check_publishers(self, federation: Mapping[str, list[str]]) -> None:
        lacking = [key for key in self._needed if key in federation["missing"]]
        if lacking:
            others = ", ".join(federation["others"]) or "nobody else"
            raise HelicsError(
                f"HELICS: nobody publishes {first_of(lacking, SHOWN)} (in the federation: {others}); "
                "publish these topics, or correct plant.helics.prefix"
            )

    def _check(self, came: Mapping[str, Value], t: float) -> None:
        for key, value in came.items():
            if not isinstance(value, bool | str) and not math.isfinite(number(value)):
                raise HelicsError(f"HELICS, t = {t:g} s: {key} is not a finite number; correct its publisher")
            if key in self._island_keys and not re.fullmatch(NAME, str(value)):
                text = f"{key} must be the name of an inverter, grid or off, got {str(value)!r:.80}"
                raise HelicsError(f"HELICS, t = {t:g} s: {text}; correct its publisher")

    def _decoded(self, text: str, t: float) -> tuple[PlantEvent, ...]:
        try:
            return decode_foreign(msgspec.json.Decoder(tuple[PlantEvent, ...]).decode, text)
        except msgspec.DecodeError as error:
            key = topics.events(self._helics.prefix).key
            return (PlantEvent(t=t, kind="warning", subject=key, text=f"{key} cannot be read: {error}"),)


_COLUMNS = len(SENSORS) + len(topics.HELD)


class BridgedPlant(RecordedPlant):
    """A plant whose inverters without an agent of ours follow set-points of outside federates.

    At each record time t it publishes what it has at t. It asks for the first record time after a tick before it
    computes that tick: so set-points that are published between are in force from the tick on, as an agent's are.
    """

    def __init__(self, build: Callable[[], LivePlant], config: PlantConfig) -> None:
        helics = settings_of(config.settings)
        # its broker must be there at once: others give up to connect while a plant is compiled for the first time
        self._federate = HelicsFederate(helics, config.deadline)
        try:
            plant = self._plant = build()
        except BaseException as error:
            self._federate.abort(f"its plant cannot start: {error}")
            raise
        self._T_c, self._record = config.T_c, config.record_step
        self._end_tick = None if config.end is None else round(config.end / config.T_c)
        self._prefix = prefix = helics.prefix
        self.inverters = plant.inverters
        self._outside = tuple(name for name in plant.inverters if name not in config.agents)
        """Inverters that outside federates control."""
        readings = plant.measure()
        self._held = {name: (readings[name].P_set, readings[name].V_set) for name in self._outside}
        self._tick = 0
        self._rows, self._events = list(plant.take_rows()), list(plant.take_events())
        self._sent: dict[str, Value] = {}
        """Flags and names that were published last: they go out when they change."""
        self._outgoing: dict[str, Value] = {}
        """Values to publish with the next step."""
        own = [
            topic
            for name in plant.inverters
            for topic in (*topics.sensors(prefix, name), *topics.held(prefix, name), *topics.where(prefix, name))
        ]
        asked = [topic for name in self._outside for topic in topics.set_points(prefix, name)]
        publish = self._measured(readings) | self._as_value(self._events)
        try:
            federation = self._federate.begin([*own, topics.events(prefix)], asked, publish)
            self._note_absent(federation, {topic.key for topic in asked})
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

    @property
    def switches(self) -> Mapping[str, bool]:
        return self._plant.switches

    def switch(self, name: str, action: str, *, synchronised: bool = False) -> bool:
        return self._plant.switch(name, action, synchronised=synchronised)

    @property
    def loads(self) -> Mapping[str, complex]:
        return self._plant.loads

    def set_load(self, name: str, setting: LoadSetting) -> str:
        return self._plant.set_load(name, setting)

    def advance(self) -> None:
        """Take the outside set-points of this tick, advance, and publish every row at its time."""
        first = time_of(self._tick * round(self._T_c / self._record) + 1, self._record)
        self._take(self._federate.step(self._outgoing, first, needed=bool(self._outside)))
        for name, (P_set, V_set) in self._held.items():
            self._plant.hold(name, P_set, V_set)
        self._plant.advance()
        self._tick += 1
        rows, events = self._plant.take_rows(), self._plant.take_events()
        self._rows += rows
        self._events += events
        for row, following in pairwise(rows):
            self._take(self._federate.step(self._row(row), following[0], needed=False))
        self._outgoing = self._measured(self._plant.measure()) | self._as_value(events)

    def close(self) -> None:
        """Publish the last values and leave; end the federation if the run has not reached its end."""
        if self._tick == self._end_tick:
            self._federate.end(self._outgoing)
        else:
            self._federate.abort(f"the run ended at t = {time_of(self._tick, self._T_c):g} s, before its end")
        self._plant.close()

    def _take(self, came: Mapping[str, Value]) -> None:
        """Keep the set-points that came for the next tick."""
        for name, (P_set, V_set) in self._held.items():
            P, V = (came.get(topic.key) for topic in topics.set_points(self._prefix, name))
            self._held[name] = (P_set if P is None else number(P), V_set if V is None else number(V))

    def _row(self, row: tuple[float, ...]) -> dict[str, Value]:
        """Return a recorded row as values."""
        values: dict[str, Value] = {}
        for i, name in enumerate(self.inverters):
            keys = (*topics.sensors(self._prefix, name), *topics.held(self._prefix, name))
            columns = row[1 + i * _COLUMNS : 1 + (i + 1) * _COLUMNS]
            values |= {topic.key: value for topic, value in zip(keys, columns, strict=True)}
        return values

    def _measured(self, readings: Mapping[str, Reading]) -> dict[str, Value]:
        """Return the readings as values, flags and names only if they have changed."""
        values: dict[str, Value] = {}
        for name, r in readings.items():
            keys = (*topics.sensors(self._prefix, name), *topics.held(self._prefix, name))
            numbers = (r.f, r.P, r.Q, r.V, r.P_set, r.V_set)
            values |= {topic.key: float(value) for topic, value in zip(keys, numbers, strict=True)}
            flags: tuple[Value, ...] = (r.grid_connected, r.island)
            for topic, value in zip(topics.where(self._prefix, name), flags, strict=True):
                if self._sent.get(topic.key) != value:
                    values[topic.key] = value
        self._sent |= {key: value for key, value in values.items() if not isinstance(value, float)}
        return values

    def _as_value(self, events: Iterable[PlantEvent]) -> dict[str, Value]:
        """Return events as the value of their topic; nothing without any."""
        text = msgspec.json.encode(tuple(events)).decode()
        return {topics.events(self._prefix).key: text} if text != "[]" else {}

    def _note_absent(self, federation: Mapping[str, list[str]], asked: set[str]) -> None:
        """Note the inverters that nobody outside controls; refuse to run if that is all of them."""
        absent = [
            name
            for name in self._outside
            if all(topic.key in federation["missing"] for topic in topics.set_points(self._prefix, name))
        ]
        if absent and len(absent) == len(self._outside):
            others = ", ".join(federation["others"]) or "nobody else"
            raise HelicsError(
                f"HELICS: nobody publishes {sorted(asked)[0]} or another set-point (in the federation: {others}); "
                "publish one, or let agents of ours control: --outside none"
            )
        for name in absent:
            text = f"nobody publishes set-points of {name}: it stays on primary droop at its first ones"
            self._events.append(PlantEvent(t=0.0, kind="warning", subject=name, text=text))
