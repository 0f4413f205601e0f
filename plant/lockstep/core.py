"""The plant's side of simulated time, sans-IO: tokens and messages in, actions out.

A driver (`plant.runtime` over Zenoh, `scenarios.drivers.inprocess` on a bus) does, from one thread,

    side.appeared(key, now) | side.vanished(key, now)       a liveliness token came or went
    side.received(key, payload, now)                        a message, or the answer to a `Fetch`
    side.work(now)                                          at most one tick of the plant, if all is here for it
    for action in side.take_actions(): ...                  do it, in this order
    side.expire(now)                                        when `side.until` has passed

until `side.over`, the last actions included. `now` is the driver's clock (s) and serves deadlines only.

With everybody there it sends `Prepare` with the roster; with everybody ready, Measurement(0). When the whole roster has
sent State(k), the set-points are held, the plant goes on to k+1, and sends Measurement(k+1), and so on. The phases of
this are written in `waiting`, who takes part in `roster`; why there is no deadlock, in `agents.lockstep.core`.
"""

from __future__ import annotations

from plant.config import PlantConfig
from plant.interface import PlantLike
from plant.lockstep.roster import Ask, Break, Connect, Dismiss, Note, Refuse, Roster, Step
from plant.lockstep.waiting import Phase, Waiting
from plant.reporting import measurement_of
from plant.side import CLOSING, LINK_TICKS, Side
from wire.codec import encode
from wire.endpoint import Route
from wire.links import Links, is_usable
from wire.messages import AnyMessage, LinkReport, Nameplate, PlantEvent, Ready, State
from wire.patience import Awaited

TELEMETRY_TICKS = 10
"""Telemetry is sent at tick 0 and then every so many ticks: enough for a progress bar, few enough to be cheap."""


class PlantSide(Side):
    """The plant in simulated time.

    Parameters
    ----------
    config : PlantConfig
        Names the agents and recorders to wait for, the control period and the end.
    plant : PlantLike
        The plant at t = 0.
    links : Links, optional
        What the links to the plant do to its messages.
    """

    def __init__(self, config: PlantConfig, plant: PlantLike, links: Links | None = None) -> None:
        super().__init__(config, plant, links)
        if self._ticks is None:
            raise ValueError("end: a run in simulated time must have one; give a multiple of T_c in s")
        self.reproducible = True
        self._plant = plant
        self._roster = Roster(config.agents, plant.inverters, self._schedule)
        self.instances, self.plates = self._roster.instances, self._roster.plates
        self._waiting = Waiting(config.agents, config.recorders, self._roster, config.deadline)
        self._states: dict[str, State] = {}
        everyone = self._roster.everyone
        for name in everyone:
            self._routes[self.keys.state(name)] = Route(name, (State,), self._on_state)
            self._routes[self.keys.ready(name)] = Route(name, (Ready,), self._on_ready)
            self._routes[self.keys.report(name)] = Route(name, (LinkReport,), self._on_report)
        self.subscriptions = tuple(self._routes)
        """Keys to subscribe to before the token is declared."""
        self._measurement_keys = {name: self.keys.measurement(name) for name in everyone}

    # ---------------------------------------------------------------- what the driver needs

    @property
    def phase(self) -> Phase:
        """What the plant waits for."""
        return self._waiting.phase

    @property
    def publications(self) -> tuple[str, ...]:
        """Keys to be published on."""
        return self.keys.control, self.keys.telemetry, *self._measurement_keys.values()

    @property
    def over(self) -> bool:
        """Whether the driver should close."""
        return self.phase == "over"

    @property
    def wanted(self) -> int:
        """Number of messages without which the plant cannot go on."""
        return self._waiting.wanted

    @property
    def until(self) -> float | None:
        """When the deadline of the present wait passes (s on the driver's clock)."""
        return self._waiting.until

    def start(self, now: float) -> None:
        """Begin to wait for the agents."""
        self._waiting.for_tokens(now)
        self._gather(now)

    def missing(self) -> tuple[Awaited, ...]:
        """Who is awaited, and for what."""
        return self._waiting.missing(self._recorders)

    def expire(self, now: float) -> None:
        """End the run if the deadline has passed."""
        if self.until is not None and now >= self.until:
            if self.phase == "closing":
                self._be_over()
            elif missing := self.missing():  # else the last that was awaited has just come
                self.abort(self._waiting.complaint(missing, now), now)

    def abort(self, reason: str, now: float) -> None:
        """End the run because something went wrong."""
        if self.phase not in ("closing", "over"):
            self.outcome = reason
            self.reproducible = False
            self._close(reason, now)

    interrupt = abort
    """End the run because this process must leave."""

    # ---------------------------------------------------------------- liveliness

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared."""
        match self.keys.parts(key):
            case ("alive", "recorder", name):
                self._tokens.add(key)
                self._recorders.add(name)
                self._gather(now)
            case ("alive", "agent", name, instance):
                self._tokens.add(key)
                gathering = self.phase == "gathering"
                self._do(self._roster.appeared(name, instance, t=self.t, gathering=gathering), now)

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        self._tokens.discard(key)
        match self.keys.parts(key):
            case ("alive", "recorder", name):
                self._recorders.discard(name)
            case ("alive", "agent", name, instance) if self.instances.get(name) != instance:
                self._gone(name, instance)
            case ("alive", "agent", name, instance):
                self._gone(name, instance)
                steps = self._roster.died(name, t=self.t, begun=self._waiting.begun)
                if self.phase not in ("closing", "over"):
                    self.reproducible = False
                    self._waiting.lost(name)
                    self._do(steps, now)
                    if self.phase == "preparing":  # nobody can get ready to hear the dead
                        self._prepare(now)
        if self.phase == "closing" and self._all_have_gone():
            self._be_over()

    # ---------------------------------------------------------------- messages

    def _used(self, message: AnyMessage, now: float) -> None:
        self._waiting.heard(message.sender, message.seq, now)

    def _on_state(self, state: State, payload: bytes, now: float) -> None:
        self._waiting.state(state, self.tick)
        self._note_state(state)
        if is_usable(self._links, state, payload, state.t, self.admission):
            self._states[state.sender] = state

    def _on_ready(self, ready: Ready, payload: bytes, now: float) -> None:
        self._waiting.ready(ready)

    def _on_nameplate(self, plate: Nameplate, now: float) -> None:
        self.plates[plate.sender] = plate
        self._gather(now)

    # ---------------------------------------------------------------- work

    def work(self, now: float) -> bool:
        """Go on if all that is awaited is here: a roster, or one tick of the plant. Whether anything was done."""
        if self._waiting.for_messages or self.phase not in ("preparing", "ticking", "joining"):
            return False
        ticked = self.phase == "ticking"
        if ticked:
            self._finish_tick(now)
            if self.phase == "ticking":
                self._move(now)
        if self.phase == "joining":
            if self.missing():
                return ticked
            self._do(self._roster.admit(), now)
        if self.phase in ("preparing", "ticking", "joining"):
            if self._roster.changed:
                self._prepare(now)
            else:
                self._grant(now)
        return True

    def _gather(self, now: float) -> None:
        if self.phase == "gathering" and not self.missing():
            self._reporter.collect()
            self._prepare(now)
            assert set(self._roster.names) == set(self.config.agents)

    def _move(self, now: float) -> None:
        """Let leave who leaves at this tick, and begin to wait for who joins."""
        steps, joining = self._roster.move(self.tick, t=self.t)
        self._do(steps, now)
        if joining and not self.outcome:
            self._roster.joining = joining
            self._waiting.for_joiners(now)
            self._report(final=False, awaited=joining)

    def _do(self, steps: list[Step], now: float) -> None:
        for step in steps:
            match step:
                case Ask(name, instance):
                    self._fetch_nameplate(name, instance)
                case Refuse(name, instance, reason):
                    self.stop(self.keys.dismissal(name, instance), reason, refused=True)
                case Dismiss(name, instance, reason):
                    if instance:
                        self.stop(self.keys.dismissal(name, instance), reason)
                case Note(name, text):
                    self._reporter.note(PlantEvent(t=self.t, kind="roster", subject=name, text=text))
                case Connect(name, on):
                    self._connect(name, on, now)
                case Break(reason):
                    self.abort(reason, now)

    def _connect(self, name: str, on: bool, now: float) -> None:
        if self.outcome:
            return
        try:
            self._plant.connect(name, on)
        except RuntimeError as error:
            self.cause = error
            self.abort(f"plant at t = {self.t:g} s: {error}", now)
        else:
            self._reporter.collect()

    def _prepare(self, now: float) -> None:
        prepare = self._roster.prepare(incarnation=self.config.incarnation, t=self.t)
        self._waiting.for_ready(prepare.seq, prepare.roster, now)
        self._publish(self.keys.control, encode(prepare))

    def _grant(self, now: float) -> None:
        """Send every agent its measurement, and with it the grant of this tick."""
        t, tick, roster, incarnation = self.t, self.tick, self._roster.names, self.config.incarnation
        self._waiting.for_states(tick, roster, now)
        readings = self._plant.measure()
        for name in roster:
            measurement = measurement_of(name, readings[name], incarnation=incarnation, tick=tick, t=t, roster=roster)
            self._publish(self._measurement_keys[name], encode(measurement))
        if tick == 0:
            self._report(final=False)

    def _finish_tick(self, now: float) -> None:
        self._states.update((state.sender, state) for state in self._news(self.t))
        for name in self._roster.names:
            if (state := self._states.get(name)) is not None:
                self._plant.hold(name, state.P_set, state.V_set)
        self._states = {}
        try:
            self._plant.advance()
        except RuntimeError as error:
            self.cause = error
            self.abort(str(error), now)
            return
        self.tick += 1
        self._reporter.collect()
        if self.tick == self._ticks:
            self._close("end of the scenario", now)
        elif self.tick % TELEMETRY_TICKS == 0:
            self._report(final=False)
            if self.tick % LINK_TICKS == 0:
                self._report_links()

    # ---------------------------------------------------------------- telemetry and the end

    def _report(self, *, final: bool, awaited: tuple[str, ...] = ()) -> None:
        self._telemetry(final=final, reproducible=self.reproducible, awaited=awaited)

    def _close(self, reason: str, now: float) -> None:
        self._tell_the_end(reason)
        self._waiting.to_close(now + CLOSING)
        if self._all_have_gone():
            self._be_over()

    def _be_over(self) -> None:
        self._send_the_last()
        self._waiting.be_over()
