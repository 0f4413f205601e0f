"""What the page shows of a run: fed by messages, read out as frames. Pure: messages and the time are arguments.

A frame has what is new since the reader's `Cursor`, and the present values. So any number of pages read at their own
pace, and nothing waits for a slow one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping
from typing import Literal

import msgspec

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.scenarios.emulation.link_data import LinkStatus
from gridpeers.scenarios.live.feeder_map import FeederMap
from gridpeers.scenarios.live.run_monitor import SILENT, InverterStatus, PlantStatus, RunMonitor
from gridpeers.viewer.dead_buses import dead_buses
from gridpeers.viewer.link_states import AGE_STEP, LinkStates, LinkView
from gridpeers.viewer.strips import Point, Strips
from gridpeers.wire.messages import AgentStatus, PlantEvent, Telemetry

KEPT = 200  # Most events that are kept for a page that comes later


class EventView(msgspec.Struct, frozen=True):
    number: int
    t: float
    kind: str
    subject: str
    text: str


class Cursor(msgspec.Struct, frozen=True):
    run: int = -1
    """Number of the run's plant, counted by the view."""
    t: float = -1.0
    event: int = 0
    links: int = 0
    switches: dict[str, bool] | None = None
    loads: dict[str, tuple[float, float]] | None = None
    dead: tuple[int, ...] | None = None


class Frame(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    live: LivenessView
    t: float | None
    pace: str
    speed: float = 1.0
    inverters: tuple[InverterStatus, ...]
    reset: bool = False
    """All that the page has so far is of another run."""
    names: tuple[str, ...] = ()
    """Inverters in the order of the points; with the points of the first frame, or when they change."""
    f_nom: float = 0.0
    points: tuple[Point, ...] = ()
    events: tuple[EventView, ...] = ()
    links: dict[str, tuple[LinkView, ...]] = {}
    switches: dict[str, bool] | None = None
    loads: dict[str, tuple[float, float]] | None = None
    """Real (W) and reactive power (var) of each load that was set in this run, if any has changed."""
    dead: tuple[int, ...] | None = None
    """Numbers of the de-energised buses, if they have changed."""


class RunView:
    """Collect a run's messages for the page; ages of links come in steps (s)."""

    def __init__(self, run: str, age_step: float = AGE_STEP) -> None:
        self._monitor = RunMonitor(run)
        self.feeder_map: FeederMap | None = None
        self.wants_status = True
        """The plant is to be asked for its status: at first, after a change of switches or loads, after a restart."""
        self._liveness, self._strips, self._links = Liveness(), Strips(), LinkStates(age_step)
        self._configs: dict[str, AgentConfig] = {}
        self._names: tuple[str, ...] = ()
        self._run = 0
        self._events: deque[EventView] = deque(maxlen=KEPT)
        self._known_events: deque[PlantEvent] = deque(maxlen=KEPT)
        self._count = 0
        self._switches: dict[str, bool] = {}
        self._loads: dict[str, tuple[float, float]] = {}
        self._into: dict[str, tuple[int, tuple[LinkView, ...]]] = {}
        """Links into each agent, with the version at which they changed."""
        self._version = 0
        self._status_at: dict[str, float] = {}
        self._islands: dict[str, str] = {}
        self._present: frozenset[str] = frozenset()
        self._energised: tuple[FeederMap, dict[str, bool], frozenset[str]] | None = None
        self._dead: tuple[int, ...] = ()

    @property
    def inverters(self) -> tuple[str, ...]:
        return self._monitor.inverters

    @property
    def any_impaired(self) -> bool:
        return self._links.any_impaired

    def config(self, config: AgentConfig) -> None:
        self._configs[config.name] = config
        self._monitor.config(config)

    def telemetry(self, message: Telemetry, now: float) -> None:
        """Take the plant's telemetry; `now` is the client's clock (s)."""
        self._monitor.telemetry(message, now)
        if self._liveness.heard(message.epoch, now, ended=message.outcome if message.final else None):
            self._begin_again()
        if message.inverters != self._names:
            self._strips.clear()
            self._names = message.inverters
        self._strips.add(message.inverters, message.rows, self._configs)
        self._take_events(message.events)

    def plant_status(self, status: PlantStatus) -> None:
        self._monitor.plant_status(status)
        self.wants_status = False
        self._switches, self._loads = status.switches, status.loads
        self._take_events(status.events, old=True)

    def status(self, message: AgentStatus, now: float) -> None:
        self._note_status(message, now)
        self._renew_links(message.sender)

    def statuses(self, messages: Collection[AgentStatus], rates: Mapping[str, float], now: float) -> None:
        """Take the statuses of all agents at one moment, and the messages per s that each of them sends."""
        for message in messages:
            self._note_status(message, now)
        self._links.rates(rates, now)
        for message in messages:  # a link needs what its sender says as well
            self._renew_links(message.sender)

    def accounts(self, receiver: str, statuses: Mapping[str, LinkStatus]) -> None:
        self._links.accounts(receiver, statuses)
        self._renew_links(receiver)

    def presence(self, *, plant: bool, agents: Collection[str], now: float) -> None:
        self._liveness.token(there=plant, now=now)
        self._present = frozenset(agents)

    def forget_silent(self, now: float) -> None:
        """Show no links of agents that have been silent: what they said is not of now."""
        for name, (_, links) in list(self._into.items()):
            if links and (name not in self._present or now - self._status_at[name] > SILENT):
                self._note_links(name, ())

    def frame(self, cursor: Cursor, now: float) -> tuple[Frame, Cursor]:
        reset = cursor.run != self._run
        if reset:
            cursor = Cursor(run=self._run)
        live = self._liveness.at(now)
        snapshot = self._monitor.snapshot(self._present, now, current=live.word == "live")
        if live.word == "live":
            self._note_dead(snapshot.inverters)
        points = tuple(self._strips.since(cursor.t))
        f_nom = next((config.f_nom for config in self._configs.values()), 0.0)
        frame = Frame(
            live=live,
            t=snapshot.t,
            pace=snapshot.pace if live.word == "live" else "",
            speed=snapshot.speed,
            inverters=snapshot.inverters,
            reset=reset,
            names=self._names if points and cursor.t < 0.0 else (),
            f_nom=f_nom if reset or cursor.t < 0.0 else 0.0,
            points=points,
            events=tuple(event for event in self._events if event.number > cursor.event),
            links={name: links for name, (version, links) in self._into.items() if version > cursor.links},
            switches=self._switches if self._switches != cursor.switches else None,
            loads=self._loads if self._loads != cursor.loads else None,
            dead=self._dead if self._dead != cursor.dead else None,
        )
        later = Cursor(
            run=self._run,
            t=points[-1][0] if points else cursor.t,
            event=self._count,
            links=self._version,
            switches=self._switches,
            loads=self._loads,
            dead=self._dead,
        )
        return frame, later

    def _note_dead(self, inverters: Collection[InverterStatus]) -> None:
        """Find the de-energised buses anew, if a switch or an inverter has changed."""
        on = frozenset(one.name for one in inverters if one.P or one.Q)
        if self.feeder_map is not None and self._energised != (now := (self.feeder_map, self._switches, on)):
            self._energised = now
            self._dead = dead_buses(*now)

    def _begin_again(self) -> None:
        self._run += 1
        self._strips.clear()
        self._links.clear()
        self._into.clear()
        self._events.clear()
        self._known_events.clear()
        self.wants_status = True

    def _take_events(self, events: tuple[PlantEvent, ...], *, old: bool = False) -> None:
        for event in events:
            if event in self._known_events:
                continue
            self._known_events.append(event)
            self._count += 1
            self._events.append(EventView(self._count, event.t, event.kind, event.subject, event.text))
            self.wants_status |= event.kind in ("switch", "load") and not old

    def _note_status(self, message: AgentStatus, now: float) -> None:
        self._monitor.status(message, now)
        self._status_at[message.sender] = now
        self._islands[message.sender] = message.island
        self._links.status(message, now)

    def _renew_links(self, receiver: str) -> None:
        config = self._configs.get(receiver)
        max_age = 0.25 if config is None else config.control.degraded_communication.max_age or config.max_age
        self._note_links(receiver, self._links.into(receiver, self._islands, max_age))

    def _note_links(self, receiver: str, links: tuple[LinkView, ...]) -> None:
        if self._into.get(receiver, (0, ()))[1] != links:
            self._version += 1
            self._into[receiver] = self._version, links


FROZEN = 0.7
"""Time (s) without telemetry after which a plant that is there counts as frozen: it publishes five times a second."""

Word = Literal["waiting", "live", "frozen", "gone", "ended", "record"]


class LivenessView(msgspec.Struct, frozen=True, kw_only=True):
    word: Word
    text: str
    since: float | None = None
    """How long ago (s) the last word of the plant came, if that is not now."""
    restarts: int = 0
    """Other plants that have taken up the run since the view began."""


class Liveness:
    """Decide from tokens and telemetry whether numbers are of now."""

    def __init__(self) -> None:
        self._epoch: int | None = None
        self._heard_at: float | None = None
        self._gone_at: float | None = None
        self._end: str | None = None
        self._restarts = 0

    def heard(self, epoch: int, now: float, *, ended: str | None) -> bool:
        """Note telemetry of a plant; `ended` is why its run ended, if it did. Return whether another plant sent it."""
        another = self._epoch is not None and epoch != self._epoch
        self._restarts += another
        self._epoch, self._heard_at, self._end, self._gone_at = epoch, now, ended, None
        return another

    def token(self, *, there: bool, now: float) -> None:
        if there:
            self._gone_at = None
        elif self._gone_at is None:
            self._gone_at = now

    def at(self, now: float) -> LivenessView:
        word: Word = "live"
        text, silent = "live", None if self._heard_at is None else now - self._heard_at
        if self._end is not None:
            word, text = "ended", f"The run has ended{': ' + self._end if self._end else ''}."
        elif silent is None:
            word, text = "waiting", "The run has not begun: the plant waits for its agents."
        elif self._gone_at is not None:
            word, text = "gone", f"The plant is gone; its last message came {silent:.1f} s ago."
        elif silent > FROZEN:
            word, text = "frozen", f"The plant has been silent for {silent:.1f} s: frozen, or out of reach."
        if self._restarts and word != "live":
            text += f" The plant was restarted {self._restarts} times."
        since = None if silent is None or word == "live" else round(silent, 1)
        return LivenessView(word=word, text=text, since=since, restarts=self._restarts)
