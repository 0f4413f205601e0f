"""The plant's side of simulated time, sans-IO: tokens and messages in, actions out.

A driver (`plant.runtime` over Zenoh, `scenarios.drivers.inprocess` on a bus) does, from one thread,

    side.appeared(key, now) | side.vanished(key, now)       a liveliness token came or went
    side.received(key, payload, now)                        a message, or the answer to a `Fetch`
    side.work(now)                                          at most one tick of the plant, if all is here for it
    for action in side.take_actions(): ...                  do it, in this order
    side.expire(now)                                        when `side.until` has passed

until `side.over`, the last actions included. `now` is the driver's clock (s) and serves deadlines only.

**Phases.** *gathering*: until every agent of the configuration has a token and a nameplate, and every recorder a token.
*preparing*: `Prepare` with the roster is out, until every agent on it is `Ready`. *ticking*: Measurement(k) is out,
until the whole roster has sent State(k); then the set-points are held, the plant goes on to k+1, and so on. A change of
the roster goes through *preparing* again, between two ticks. *joining*: the tick is held until those whom the scenario
lets join have a token and a nameplate; telemetry has told, once, that they are awaited. *closing*: `Stop` and the last
telemetry are out, until all tokens are gone, as proof that everybody has heard it.

An agent that the scenario lets leave is told to stop, and its inverter goes off the network; one that joins finds its
inverter on the network again, at no load. As the tick is held, it shows nowhere how long a process took to come up.

An agent that dies is taken off the roster and the run goes on, marked not reproducible; one that dies before tick 0
ends the run. Why there is no deadlock is written in `agents.lockstep`.
"""

from __future__ import annotations

from typing import Literal

from plant.config import PlantConfig
from plant.interface import PlantLike
from plant.reporting import measurement_of
from plant.side import CLOSING, LINK_TICKS, Side
from wire.actions import Fetch
from wire.codec import RejectedError, decode, encode
from wire.links import Links
from wire.messages import PLANT, LinkReport, Nameplate, PlantEvent, Prepare, Ready, State
from wire.patience import Awaited, Patience

Phase = Literal["gathering", "preparing", "ticking", "joining", "closing", "over"]

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
        self.phase: Phase = "gathering"
        self.reproducible = True
        self._plant = plant
        self._patience = Patience(PLANT, config.deadline)
        later = self._schedule.joiners.difference(config.agents)
        self._everyone = (*config.agents, *(name for name in plant.inverters if name in later))
        """All who may ever take part, in the order of the inverters."""
        self._joining: tuple[str, ...] = ()
        """Whom the tick is held for."""
        self._roster: tuple[str, ...] = ()
        self._roster_number = -1
        self._roster_changed = False
        self._waiting: set[str] = set()
        self._states: dict[str, State] = {}
        self._state_keys = {self.keys.state(name): name for name in self._everyone}
        self._ready_keys = {self.keys.ready(name): name for name in self._everyone}
        self._report_keys = {self.keys.report(name) for name in self._everyone}
        self._measurement_keys = {name: self.keys.measurement(name) for name in self._everyone}

    # ---------------------------------------------------------------- what the driver needs

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """Keys to subscribe to before the token is declared."""
        return *self._state_keys, *self._ready_keys, *self._report_keys

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
        return max(1, len(self._waiting))

    @property
    def until(self) -> float | None:
        """When the deadline of the present wait passes (s on the driver's clock)."""
        return self._patience.until

    def start(self, now: float) -> None:
        """Begin to wait for the agents."""
        self._patience.renew(now)
        self._gather(now)

    def missing(self) -> tuple[Awaited, ...]:
        """Who is awaited, and for what."""
        agents = self._everyone
        match self.phase:
            case "gathering":
                recorders = [Awaited("token", name) for name in self.config.recorders if name not in self._recorders]
                return (*self._absent(self.config.agents), *recorders)
            case "joining":
                return self._absent(self._joining)
            case "preparing":
                return tuple(Awaited(f"Ready({self._roster_number})", name) for name in agents if name in self._waiting)
            case "ticking":
                return tuple(Awaited(f"State({self.tick})", name) for name in agents if name in self._waiting)
        return ()

    def _absent(self, names: tuple[str, ...]) -> tuple[Awaited, ...]:
        absent = [Awaited("token", name) for name in names if name not in self.instances]
        mute = [Awaited("nameplate", name) for name in names if name in self.instances and name not in self.plates]
        return (*absent, *mute)

    def expire(self, now: float) -> None:
        """End the run if the deadline has passed."""
        if self.until is not None and now >= self.until:
            if self.phase == "closing":
                self._be_over()
            elif missing := self.missing():  # else the last that was awaited has just come
                self.abort(self._patience.complaint(missing, now), now)

    def abort(self, reason: str, now: float) -> None:
        """End the run because something went wrong."""
        if self.phase not in ("closing", "over"):
            self.outcome = reason
            self.reproducible = False
            self._close(reason, now)

    def interrupt(self, reason: str, now: float) -> None:
        """End the run because this process must leave."""
        self.abort(reason, now)

    # ---------------------------------------------------------------- liveliness

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared; of two processes of one name the first takes part."""
        match self.keys.parts(key):
            case ("alive", "recorder", name):
                self._tokens.add(key)
                self._recorders.add(name)
                self._gather(now)
            case ("alive", "agent", name, instance):
                self._tokens.add(key)
                refusal = self._refusal(name, instance)
                if refusal:
                    self.stop(self.keys.dismissal(name, instance), refusal, refused=True)
                elif name not in self.instances:
                    self.instances[name] = instance
                    self._actions.append(Fetch(self.keys.nameplate(name, instance)))

    def _refusal(self, name: str, instance: str) -> str:
        if name not in self._everyone:
            return f"{name}: the plant waits for no agent of this name, only for {', '.join(self._everyone)}"
        if self.instances.get(name, instance) != instance:
            return f"{name}: another agent of this name takes part in the run already; give this one another name"
        if self.phase == "gathering" and name not in self.config.agents:
            return f"{name}: the scenario lets it join later; start it when the plant awaits it"
        if self.phase != "gathering" and name not in self.instances and name not in self._joining:
            return f"{name}: the run has begun, at t = {self.t:g} s; an agent can join only before its start"
        return ""

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        self._tokens.discard(key)
        match self.keys.parts(key):
            case ("alive", "recorder", name):
                self._recorders.discard(name)
            case ("alive", "agent", name, instance) if self.instances.get(name) == instance:
                self._lose(name, now)
        if self.phase == "closing" and self._all_have_gone():
            self._be_over()

    def _lose(self, name: str, now: float) -> None:
        del self.instances[name]
        self.plates.pop(name, None)
        if self.phase == "gathering" or (self.phase == "preparing" and self._roster_number == 0):
            self.abort(f"{name} died before the run began", now)
        elif name in self._joining:
            self.abort(f"{name} died at t = {self.t:g} s, before it had joined", now)
        elif self.phase in ("preparing", "ticking", "joining"):
            self.reproducible = False
            self._roster_changed = True
            self._waiting.discard(name)
            text = f"{name} died at t = {self.t:g} s; its inverter stays on primary droop at its last set-points"
            self._note(name, text)
            if self.phase == "preparing":  # nobody can get ready to hear the dead
                self._prepare(now)

    def _note(self, name: str, text: str) -> None:
        self._reporter.note(PlantEvent(t=self.t, kind="roster", subject=name, text=text))

    # ---------------------------------------------------------------- messages

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message; what cannot be used is counted and dropped."""
        try:
            message = decode(payload)
            name = message.sender
            if key in self._state_keys and isinstance(message, State):
                self._check_sender(self._state_keys[key], message)
                self._on_state(message, payload)
            elif key in self._ready_keys and isinstance(message, Ready):
                self._check_sender(self._ready_keys[key], message)
                self._on_ready(message)
            elif key in self._report_keys and isinstance(message, LinkReport):
                self._forward(message, payload)
            elif isinstance(message, Nameplate) and key == self.keys.nameplate(name, self.instances.get(name, "")):
                self.plates[name] = message
                self._gather(now)
            else:
                raise RejectedError("foreign", f"a {type(message).__name__} of {name}")
            self._patience.heard(name, message.seq, now)
        except RejectedError as rejected:
            self.rejects.add(rejected.kind, key, rejected.text)

    def _on_state(self, message: State, payload: bytes) -> None:
        if self.phase != "ticking" or message.seq != self.tick or message.sender not in self._waiting:
            kind = "stale" if message.seq <= self.tick else "unexpected"
            raise RejectedError(kind, f"State({message.seq}) of {message.sender} at tick {self.tick} ({self.phase})")
        if not self._is_offered(message, payload, message.t):
            self._states[message.sender] = message
        self._waiting.discard(message.sender)

    def _on_ready(self, message: Ready) -> None:
        if self.phase != "preparing" or message.seq != self._roster_number:
            raise RejectedError("stale", f"Ready({message.seq}) of {message.sender} in phase {self.phase}")
        self._waiting.discard(message.sender)

    # ---------------------------------------------------------------- work

    def work(self, now: float) -> bool:
        """Go on if all that is awaited is here: a roster, or one tick of the plant. Whether anything was done."""
        if self._waiting or self.phase not in ("preparing", "ticking", "joining"):
            return False
        ticked = self.phase == "ticking"
        if ticked:
            self._finish_tick(now)
            if self.phase == "ticking":
                self._move(now)
        if self.phase == "joining":
            if self.missing():
                return ticked
            self._admit(now)
        if self.phase in ("preparing", "ticking"):
            if self._roster_changed:
                self._prepare(now)
            else:
                self._grant(now)
        return True

    def _gather(self, now: float) -> None:
        config = self.config
        if self.phase == "gathering" and not self.missing():
            self._roster_changed = True
            self._reporter.collect()
            self._prepare(now)
            self._patience.renew(now)
            assert set(self._roster) == set(config.agents)

    def _move(self, now: float) -> None:
        """Let leave who leaves at this tick, and begin to wait for who joins."""
        leave, join, die = self._schedule.take(self.tick)
        when = f"at t = {self.t:g} s, as the scenario says"
        for name in leave:
            self._dismiss(name, f"{name} leaves {when}")
            self._connect(name, False, now)
        for name in die:
            text = f"{name} dies {when}; its inverter stays on primary droop at its last set-points"
            self._dismiss(name, text)
        join = tuple(name for name in join if name not in self.instances)
        for name in join:
            self._note(name, f"{name} joins {when}")
        if join and not self.outcome:
            self.phase, self._joining = "joining", join
            self._patience.renew(now)
            self._report(final=False, awaited=join)

    def _dismiss(self, name: str, text: str) -> None:
        """Have an agent end, as the scenario says."""
        self._note(name, text)
        instance = self.instances.pop(name, "")
        self.plates.pop(name, None)
        self._set_by.pop(name, None)
        if instance:
            self.stop(self.keys.dismissal(name, instance), text)
        self._roster_changed = True

    def _admit(self, now: float) -> None:
        """Go on with those who have joined: their inverters are on the network, at no load."""
        self.phase, self._roster_changed = "ticking", True
        for name in self._joining:
            self._connect(name, True, now)
        self._joining = ()

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
        self._roster = tuple(name for name in self._everyone if name in self.instances)
        self._roster_number += 1
        self._roster_changed = False
        self._waiting = set(self._roster)
        self.phase = "preparing"
        self._patience.renew(now)
        prepare = Prepare(
            sender=PLANT,
            incarnation=self.config.incarnation,
            seq=self._roster_number,
            t=self.t,
            roster=self._roster,
            instances=tuple(self.instances[name] for name in self._roster),
        )
        self._publish(self.keys.control, encode(prepare))

    def _grant(self, now: float) -> None:
        """Send every agent its measurement, and with it the grant of this tick."""
        self.phase = "ticking"
        self._waiting = set(self._roster)
        self._patience.renew(now)
        readings = self._plant.measure()
        t, tick, roster, incarnation = self.t, self.tick, self._roster, self.config.incarnation
        for name in roster:
            measurement = measurement_of(name, readings[name], incarnation=incarnation, tick=tick, t=t, roster=roster)
            self._publish(self._measurement_keys[name], encode(measurement))
        if tick == 0:
            self._report(final=False)

    def _finish_tick(self, now: float) -> None:
        self._states.update((state.sender, state) for state in self._arrived(self.t))
        for name in self._roster:
            state = self._states.get(name)
            if state is not None:
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
        self.phase = "closing"
        self._waiting = set()
        self._patience.until = now + CLOSING
        if self._all_have_gone():
            self._be_over()

    def _be_over(self) -> None:
        self._send_the_last()
        self.phase = "over"
        self._patience.rest()
