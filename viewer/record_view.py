"""What the page shows of a record at a time: a frame as of a live run, made from the record alone.

The same `RunView` that is fed by a live run is fed with what the record has of the second before. Nothing is kept from
one time to the next but what speeds it up, so a time has the same frame whichever times were asked for before.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from itertools import takewhile
from math import cos, pi, sin

from msgspec.structs import replace

from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables import FeederError, read_feeder
from gridpeers.rooms import ROOMS
from gridpeers.scenarios.emulation.link_data import NO_MESSAGES
from gridpeers.scenarios.live.feeder_map import FeederMap, MapInverter, feeder_map
from gridpeers.scenarios.live.run_monitor import InverterStatus, PlantStatus
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.viewer.link_states import LinkView
from gridpeers.viewer.record_moments import AgentMoment, AgentMoments, LinkFaults, PlantRows
from gridpeers.viewer.run_view import Cursor, EventView, Frame, LivenessView, RunView
from gridpeers.viewer.strips import LENGTH, Point
from gridpeers.wire.messages import PLANT, AgentStatus, Pacing, PlantEvent, State, Telemetry

WINDOW = 1.0

AGE_STEP = 0.001

_STILL = Pacing(steps=0, late=0, p50=0.0, p95=0.0, p99=0.0, worst=0.0, slipped=0.0)


class RecordView:
    def __init__(self, record: RunRecord) -> None:
        self.record = record
        info = record.info
        self._configs = {config.name: config for config in info.agents}
        self._rows = PlantRows(record, self._configs)
        self._moments = AgentMoments(record)
        self._faults = LinkFaults(record)
        self.shared = info.agents[0].control.law.shared if info.agents else ()
        """What the law shares beside the paper's values."""
        self._parts = 0
        self._events: list[EventView] = []
        self._plant_events: list[PlantEvent] = []
        feeder = feeder_of(info)
        self.map: FeederMap = inverter_ring(info) if feeder is None else feeder_map(feeder)
        """The one-line diagram; the inverters in a ring if the feeder is not here."""
        self._switches = {switch.name: switch.closed for switch in self.map.switches}
        self._by_name = {name: switch.name for switch in self.map.switches for name in (switch.alias, switch.name)}
        self._tables = {load.name: (load.P, load.Q) for load in self.map.loads}
        self.missing = tuple(_missing(record, has_feeder=feeder is not None))
        """Sentences on what the record, or this host, does not have."""

    @property
    def known_end(self) -> float:
        """Latest run time (s) of which there are rows and messages: journals come into a record after the rows."""
        record, index = self.record, self.record.index
        if record.complete or record.info.level == "physics":
            return record.t_end
        for part in reversed(range(index.parts)):
            times = [journal.t for journal in index.journals_in(part) if journal.sender == PLANT]
            if times:
                return min(record.t_end, max(times))
        return record.t_end

    @property
    def events(self) -> list[EventView]:
        self._read_events()
        return self._events

    def _read_events(self) -> None:
        """Read the events of the parts that the record has got since the last time."""
        index = self.record.index
        for message in index.of_type("telemetry", Telemetry, range(self._parts, index.parts)):
            self._plant_events += message.events
            for event in message.events:
                self._events.append(EventView(len(self._events) + 1, event.t, event.kind, event.subject, event.text))
        self._parts = index.parts

    def frame(self, t: float, since: float = -1.0) -> Frame:
        agents = self._moments.at(t)
        view = RunView(self.record.info.run, AGE_STEP)
        view.feeder_map = self.map
        for config in self._configs.values():
            view.config(config)
        view.presence(plant=True, agents=self._present(t, agents), now=t)
        status = PlantStatus(
            phase="running",
            t=t,
            speed=self.record.info.plant.speed,
            pacing=_STILL,
            switches=self._switches_at(t),
            loads=self._loads_at(t),
        )
        view.plant_status(status)
        row = self._feed_row(view, t)
        self._feed_links(view, agents, t)
        frame, _ = view.frame(Cursor(), t)
        links: dict[str, tuple[LinkView, ...]] = dict.fromkeys(self._configs, ()) | frame.links
        stale = row is None or t - row > self._rows.longest_gap
        text = "The record has no rows of this time." if stale else "record"
        points = tuple(self._with_shared(self._rows.points(max(since, t - LENGTH), t)))
        return replace(
            frame,
            live=LivenessView(word="record", text=text),
            t=t,
            pace="",
            speed=1.0,
            inverters=tuple(self._noted(one, agents) for one in frame.inverters),
            reset=since < 0.0 or since < t - LENGTH,
            names=self.record.info.inverters,
            points=points,
            events=(),
            links=links,
        )

    def _with_shared(self, points: Sequence[Point]) -> Iterator[Point]:
        """Yield points with what each inverter shared last, one quantity after the other; None once it is too old."""
        if not (self.shared and points):
            yield from points
            return
        longest = max(WINDOW, 2.0 * self.record.info.T_c)
        states = self.record.index.messages(State, None, points[0][0] - longest, points[-1][0])
        coming = deque(sorted(states, key=lambda state: state.t))
        last: dict[str, State] = {}
        for t, values, beyond in points:
            while coming and coming[0].t <= t + 1e-9:
                state = coming.popleft()
                last[state.sender] = state
            fresh = {name: state.shared for name, state in last.items() if t - state.t <= longest}
            shared = (fresh.get(name, {}).get(it.name) for it in self.shared for name in self.record.info.inverters)
            yield t, (*values, *shared), beyond

    def decision(self, agent: str, t: float) -> str:
        self._read_events()
        return str(ROOMS.resolve("explain")(self.record, agent, t, tuple(self._plant_events)))

    def _present(self, t: float, agents: Mapping[str, AgentMoment]) -> list[str]:
        """Return the agents that were there: by their decisions, or by the schedule if the record has none.

        Behind the last journal of a record without an end nothing is known of any.
        """
        if self.record.info.level != "physics":
            return list(agents or ([] if self.record.complete else self._configs))
        plant = self.record.info.plant
        present = dict.fromkeys(plant.agents)
        for action in plant.schedule:
            if action.t <= t + 1e-9 and action.action == "join":
                present[action.inverter] = None
            elif action.t <= t + 1e-9:
                present.pop(action.inverter, None)
        return list(present)

    def _switches_at(self, t: float) -> dict[str, bool]:
        positions = dict(self._switches)
        for event in self._until(t):
            name = self._by_name.get(event.subject) if event.kind == "switch" else None
            if name is not None and event.closed is not None:
                positions[name] = event.closed
        return positions

    def _loads_at(self, t: float) -> dict[str, tuple[float, float]]:
        """Return real (W) and reactive power (var) of each load that has another one than in its table."""
        powers: dict[str, tuple[float, float]] = {}
        for event in self._until(t):
            if event.kind == "load" and event.P is not None and event.Q is not None:
                powers[event.subject] = event.P, event.Q
        return {name: power for name, power in powers.items() if power != self._tables.get(name)}

    def _until(self, t: float) -> Iterator[PlantEvent]:
        self._read_events()
        return takewhile(lambda event: event.t <= t + 1e-9, self._plant_events)

    def _feed_row(self, view: RunView, t: float) -> float | None:
        last = self._rows.last(t)
        if last is None:
            return None
        inverters, row = last
        message = Telemetry(
            sender=PLANT,
            epoch=1,
            seq=0,
            t=row[0],
            inverters=inverters,
            rows=(row,),
            events=(),
            final=False,
            outcome="",
            reproducible=False,
        )
        # a row holds until the next one: what the page takes for silence is a time of real time
        view.telemetry(message, t if t - row[0] <= self._rows.longest_gap else row[0])
        return row[0]

    def _feed_links(self, view: RunView, agents: Mapping[str, AgentMoment], t: float) -> None:
        """Feed what each agent says, what it sent in the second before, and the accounts of its links."""
        sent, faults = self._moments.sent(t - WINDOW, t), self._faults.into(t, WINDOW)
        T_c = self.record.info.T_c
        begun = T_c * (int(t / T_c + 1e-6) + 1)  # the periods of the first second
        span = max(T_c, min(WINDOW, begun))
        statuses = [_status(agent, sent[name], tuple(faults.get(name, ()))) for name, agent in agents.items()]
        view.statuses(statuses, {name: sent[name] / span for name in agents}, t)
        for name in agents:
            if impaired := faults.get(name):
                view.accounts(name, {src: replace(link, counts=NO_MESSAGES) for src, link in impaired.items()})
                view.accounts(name, impaired)

    def _noted(self, one: InverterStatus, agents: Mapping[str, AgentMoment]) -> InverterStatus:
        """Return the status of an inverter without the fields that a record does not have."""
        agent = agents.get(one.name)
        note = one.note
        if agent is not None and agent.idle:
            note = "idle: paused, without a measurement, or its law has failed"
        elif agent is None and note != "no agent":
            note = ""
        hears = one.hears if agent is None or agent.known else None
        return dataclasses.replace(one, received=None, sent=None, lost=None, hears=hears, note=note)


def _status(agent: AgentMoment, sent: int, impaired: tuple[str, ...]) -> AgentStatus:
    """Return a status with 0 in the counts that a record does not have."""
    return AgentStatus(
        sender=agent.name,
        epoch=0,
        seq=0,
        t=max(0.0, agent.t),
        phase="running",
        waits_for="",
        island=agent.island,
        neighbours=agent.neighbours,
        ages=agent.ages,
        used=agent.used,
        received=0,
        sent=sent,
        rejected=0,
        lost=0,
        ticks=0,
        missed=0,
        lateness=0.0,
        impaired=impaired,
    )


def _missing(record: RunRecord, *, has_feeder: bool) -> Iterator[str]:
    info = record.info
    if info.level == "physics":
        yield 'The record has no links and no decisions (record = "physics").'
    elif info.level == "decisions" and info.clock == "realtime":
        yield 'The record has no arrivals and no fates of messages (record = "decisions").'
    if not has_feeder:
        yield f"The feeder {info.plant.settings.feeder} is not on this host: its inverters are drawn in a ring."


def feeder_of(info: RecordInfo) -> Tables | None:
    """Return the feeder of a run; None if it is not here, or has other inverters now."""
    try:
        feeder = read_feeder(info.plant.settings.feeder, info.plant.settings.load_set)
    except (FeederError, OSError, ValueError):
        return None
    names = {row.name for row in (*feeder.inverters, *feeder.spares)}
    return feeder if names >= set(info.inverters) else None


def inverter_ring(info: RecordInfo) -> FeederMap:
    """Return a diagram that has the inverters of a run alone, in a ring, those of a microgrid beside each other."""
    configs = {config.name: config for config in info.agents}
    microgrids = list(dict.fromkeys(config.microgrid for config in info.agents))

    def group(name: str) -> int:
        return microgrids.index(configs[name].microgrid) if name in configs else len(microgrids)

    names = sorted(info.inverters, key=group)
    angles = [2.0 * pi * i / max(1, len(names)) for i in range(len(names))]
    inverters = []
    for i, name in enumerate(names):
        config = configs.get(name)
        inverters.append(MapInverter(name, i, config.kind if config else "GFL", config.microgrid if config else ""))
    return FeederMap(
        buses=tuple((name, sin(angle), cos(angle)) for name, angle in zip(names, angles, strict=True)),
        inverters=tuple(inverters),
    )
