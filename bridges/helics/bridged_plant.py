"""A plant of ours in a HELICS federation: it publishes its sensors, and outside federates give set-points."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise

import msgspec

from gridpeers.bridges.helics import topics
from gridpeers.bridges.helics.federate import HelicsError, HelicsFederate
from gridpeers.bridges.helics.helics_simulator import settings_of
from gridpeers.bridges.helics.topics import SENSORS, Value, number
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import LivePlant, ReadingLike
from gridpeers.wire.messages import LoadSetting, PlantEvent
from gridpeers.wire.timing import time_of

_COLUMNS = len(SENSORS) + len(topics.HELD)


class BridgedPlant:
    """A plant whose inverters without an agent of ours follow set-points of outside federates.

    At each record time t it publishes what it has at t. It asks for the first record time after a tick before it
    computes that tick: so set-points that are published between are in force from the tick on, as an agent's are.

    Parameters
    ----------
    build
        Builds the plant at t = 0.
    config
        Agents, times and the federation.

    Raises
    ------
    HelicsError
        If the federation does not begin.
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

    def measure(self) -> Mapping[str, ReadingLike]:
        """Read all sensors now."""
        return self._plant.measure()

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Take set-points (W, V) of an agent of ours."""
        self._plant.hold(name, P_set, V_set)

    def connect(self, name: str, on: bool) -> None:
        """Connect or disconnect an inverter."""
        self._plant.connect(name, on)

    @property
    def switches(self) -> Mapping[str, bool]:
        """Position of each switch."""
        return self._plant.switches

    def switch(self, name: str, action: str, *, synchronised: bool = False) -> bool:
        """Operate a switch."""
        return self._plant.switch(name, action, synchronised=synchronised)

    @property
    def loads(self) -> Mapping[str, complex]:
        """Power at nominal voltage (VA) of each load that was set."""
        return self._plant.loads

    def set_load(self, name: str, setting: LoadSetting) -> str:
        """Set a load."""
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

    def take_rows(self) -> tuple[tuple[float, ...], ...]:
        """Take out the rows recorded since the last call."""
        rows, self._rows = tuple(self._rows), []
        return rows

    def take_events(self) -> tuple[PlantEvent, ...]:
        """Take out the events since the last call."""
        events, self._events = tuple(self._events), []
        return events

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

    def _measured(self, readings: Mapping[str, ReadingLike]) -> dict[str, Value]:
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
