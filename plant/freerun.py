"""The plant's side of wall-clock time, sans-IO: tokens, messages and the time in, actions out.

Driven as `plant.lockstep` is; but here the clock decides. Step k is due at start + k T_c / speed. `expire` then
measures and publishes to every agent that is present; `work` holds the set-points heard until then and advances the
plant to k + 1: ahead of time, so that what is published at the next due time is ready. A state thus takes effect at the
first step after it came, as it would on a real inverter; nothing is applied to a time that is past.

**Phases.** *gathering*: until all agents and recorders of the configuration are there, or `wait_for_agents` is over.
*running*. *closing*: the last telemetry is out, and `Stop`, until all tokens are gone. *over*.

**Agents** come and go. A token and a nameplate: its inverter is put on the network, if it is not there, and its agent
is sent measurements. `Leave`: its inverter is taken off. A token gone without `Leave`: the agent died, and its inverter
stays on primary droop at its last set-points. Whom the scenario lets leave is asked to; telemetry tells, once, that
whoever joins is awaited, and the run goes on meanwhile. Of two processes of one name the first takes part, the other is
refused.
"""

from __future__ import annotations

from typing import Literal

from plant.config import PlantConfig
from plant.interface import LivePlant
from plant.pacing import TOLERATED, Pacer, sentence
from plant.reporting import Reporter, measurement_of
from plant.schedule import Schedule
from plant.service import Service
from wire.actions import Action, Fetch, Publish, Say
from wire.clock import ticks_until, time_of
from wire.codec import RejectedError, Rejects, decode, encode
from wire.keys import Keys, check_name
from wire.messages import PLANT, AnyMessage, Command, Leave, Nameplate, PlantEvent, State, Stop

Phase = Literal["gathering", "running", "closing", "over"]

TELEMETRY = 0.2
"""Time (s, wall) between two telemetry messages."""

CLOSING = 2.0
"""Longest wait for the others to close (s)."""

LEAD = 0.25
"""Time (s, wall) from the last agent's nameplate to step 0: the agents are still busy finding each other."""

HEARD = 1.0
"""Time (s, wall) after its last state for which an agent is told to the others as one that is heard."""

WANTED = 1 << 30
"""While it runs, messages wait for the next step; only tokens and words wake the plant before."""


class FreePlant:
    """The plant in wall-clock time.

    Parameters
    ----------
    config : PlantConfig
        Names the agents to wait for, the control period, the speed and the end.
    plant : LivePlant
        The plant at t = 0.
    """

    def __init__(self, config: PlantConfig, plant: LivePlant) -> None:
        for name in config.agents:
            check_name("agents", name)
            if name not in plant.inverters:
                raise ValueError(f'agents: no inverter "{name}"; inverters are {", ".join(plant.inverters)}')
        if not config.speed > 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        self.keys = Keys(config.run)
        self.rejects = Rejects(PLANT)
        self.phase: Phase = "gathering"
        self.outcome = ""
        """Why the run broke; empty while it goes well."""
        self.cause: RuntimeError | None = None
        """What the plant raised, if that broke the run."""
        self.tick = 0
        """k: the plant stands at k T_c."""
        self.instances: dict[str, str] = {}
        """The one instance of each agent that takes part."""
        self.plates: dict[str, Nameplate] = {}
        self.config, self.plant = config, plant
        self.pacer = Pacer(config.T_c / config.speed, 0.0)
        self._ticks = None if config.end is None else ticks_until(config.end, config.T_c)
        self._telemetry_ticks = max(1, round(TELEMETRY / self.pacer.period))
        self._actions: list[Action | Say] = []
        self._recorders: set[str] = set()
        self._tokens: set[str] = set()
        """All tokens of agents and recorders that are there now, refused ones too."""
        self._states: dict[str, State] = {}
        self._last: dict[str, int] = {}
        """Number of the last state of each agent."""
        self._heard: dict[str, float] = {}
        """When the last state of each agent came."""
        self._step_due = False
        self._deadline = 0.0
        self._complained = False
        self._reporter = Reporter(config.incarnation, plant)
        self._service = Service(self)
        self._schedule = Schedule(config, plant.inverters)
        self._state_keys = {self.keys.state(name): name for name in plant.inverters}
        self._leave_keys = {self.keys.leave(name): name for name in plant.inverters}

    # ---------------------------------------------------------------- what the driver needs

    @property
    def token(self) -> str:
        """Key of the plant's liveliness token."""
        return self.keys.alive_plant

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """Keys to subscribe to before the token is declared."""
        return *self._state_keys, *self._leave_keys, self.keys.command

    @property
    def publications(self) -> tuple[str, ...]:
        """Keys to be published on."""
        return self.keys.control, self.keys.telemetry, *map(self.keys.measurement, self.plant.inverters)

    @property
    def watched(self) -> str:
        """Key expression of the tokens to watch."""
        return self.keys.any_alive

    @property
    def over(self) -> bool:
        """Whether the driver should close."""
        return self.phase == "over"

    @property
    def wanted(self) -> int:
        """Number of messages to be woken for."""
        return WANTED if self.phase == "running" else 1

    @property
    def until(self) -> float:
        """When the next step is due, or the present wait is over (s on the driver's clock)."""
        return self.pacer.due if self.phase == "running" else self._deadline

    def start(self, now: float) -> None:
        """Begin to wait for the agents."""
        self._deadline = now + max(0.0, self.config.wait_for_agents)
        self._reporter.collect()
        names = ", ".join(self.config.agents) or "nobody"
        self._say(f"run {self.config.run}: waits up to {self.config.wait_for_agents:g} s for {names}")
        self._gather(now)

    def take_actions(self) -> list[Action | Say]:
        """What is to be done now, in this order."""
        actions, self._actions = self._actions, []
        return actions

    def abort(self, reason: str, now: float) -> None:
        """End the run because something went wrong."""
        if self.phase not in ("closing", "over"):
            self.outcome = reason
            self.close(reason, now)

    def interrupt(self, reason: str, now: float) -> None:
        """Leave the run, which another plant may take up again: the agents are not told to close."""
        if self.phase not in ("closing", "over"):
            self.outcome = reason
            self._report(final=True)
            self.phase = "over"

    def close(self, reason: str, now: float) -> None:
        """End the run and tell everybody."""
        self._say(f"ends: {reason}. {self._pace()}")
        self._report(final=True)
        self.stop(self.keys.control, reason)
        self.phase = "closing"
        self._deadline = now + CLOSING
        if not self._tokens:
            self.phase = "over"

    def stop(self, key: str, reason: str, *, refused: bool = False) -> None:
        """Tell one agent, or all, to close."""
        stop = Stop(
            sender=PLANT,
            incarnation=self.config.incarnation,
            seq=self.tick,
            t=self.t,
            reason=reason,
            refused=refused,
        )
        self._actions.append(Publish(key, encode(stop)))

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
                if name not in self.plant.inverters:
                    inverters = ", ".join(self.plant.inverters)
                    self._refuse(name, instance, f"{name}: no inverter of this name; inverters are {inverters}")
                elif self.instances.get(name, instance) != instance:
                    reason = f"{name}: another agent of this name takes part in run {self.config.run} already; stop it"
                    self._refuse(name, instance, f"{reason} first (gridpeers stop {name}), or give this one another")
                else:
                    self.instances[name] = instance
                    self._actions.append(Fetch(self.keys.nameplate(name, instance)))

    def _refuse(self, name: str, instance: str, reason: str) -> None:
        self._say(f"refused {reason}")
        self.stop(self.keys.dismissal(name, instance), reason, refused=True)

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        self._tokens.discard(key)
        match self.keys.parts(key):
            case ("alive", "recorder", name):
                self._recorders.discard(name)
            case ("alive", "agent", name, instance) if self.instances.get(name) == instance:
                self._drop(name)
                if self.phase in ("gathering", "running"):
                    self._note(name, f"{name} died; its inverter stays on primary droop at its last set-points")
        if self.phase == "closing" and not self._tokens:
            self.phase = "over"

    def _drop(self, name: str) -> None:
        del self.instances[name]
        for known in (self.plates, self._states, self._last, self._heard):
            known.pop(name, None)

    # ---------------------------------------------------------------- messages

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message; what cannot be used is counted and dropped."""
        try:
            message = decode(payload)
            name = message.sender
            if key in self._state_keys and isinstance(message, State):
                self._check_sender(self._state_keys[key], message)
                if message.seq <= self._last.get(name, -1):
                    raise RejectedError("stale", f"State({message.seq}) of {name} after {self._last[name]}")
                self._last[name], self._heard[name] = message.seq, now
                self._states[name] = message
            elif key in self._leave_keys and isinstance(message, Leave):
                self._check_sender(self._leave_keys[key], message)
                self._on_leave(name, now)
            elif key == self.keys.command and isinstance(message, Command):
                self._on_command(message, now)
            elif isinstance(message, Nameplate) and key == self.keys.nameplate(name, self.instances.get(name, "")):
                self._on_nameplate(message, now)
            else:
                raise RejectedError("foreign", f"a {type(message).__name__} of {name}")
        except RejectedError as rejected:
            self.rejects.add(rejected.kind, key, rejected.text)

    def _check_sender(self, expected: str, message: AnyMessage) -> None:
        name, life = message.sender, message.incarnation
        if name != expected:
            raise RejectedError("foreign", f"sender {name}, {expected} was expected")
        plate = self.plates.get(name)
        if plate is None or life != plate.incarnation:
            raise RejectedError("ghost", f"life {life} of {name} does not take part")

    def _on_nameplate(self, plate: Nameplate, now: float) -> None:
        name = plate.sender
        if self.phase not in ("gathering", "running") or name in self.plates:
            return
        self.plates[name] = plate
        self._connect(name, True, now)
        self._note(name, f"{name} joined")
        self._gather(now)

    def _on_leave(self, name: str, now: float) -> None:
        self._drop(name)
        if self.phase in ("gathering", "running"):
            self._connect(name, False, now)
            self._note(name, f"{name} left; its inverter is off the network")

    def _on_command(self, command: Command, now: float) -> None:
        try:
            check_name("reply_to", command.reply_to)
        except ValueError as error:
            raise RejectedError("garbled", str(error)) from None
        answer = self._service.serve(command)
        self._actions.append(Publish(self.keys.answer(command.reply_to), encode(answer)))
        if command.verb == "down":
            self.close("the run was ended by command", now)

    def _connect(self, name: str, on: bool, now: float) -> None:
        try:
            self.plant.connect(name, on)
        except RuntimeError as error:
            self.cause = error
            self.abort(str(error), now)

    # ---------------------------------------------------------------- steps

    @property
    def events(self) -> tuple[PlantEvent, ...]:
        """The latest events, oldest first."""
        return tuple(self._reporter.latest)

    @property
    def t(self) -> float:
        """Run time the plant stands at (s)."""
        return time_of(self.tick, self.config.T_c)

    def _gather(self, now: float) -> None:
        """Begin, if all are there."""
        agents, recorders = set(self.config.agents), set(self.config.recorders)
        if self.phase == "gathering" and self.plates.keys() >= agents and self._recorders >= recorders:
            self._begin(now)

    def _begin(self, now: float) -> None:
        self.phase = "running"
        self.pacer = Pacer(self.pacer.period, now + LEAD)
        absent = [name for name in self.config.agents if name not in self.plates]
        if absent:
            text = f"started without the agents of {', '.join(absent)}, which stay on primary droop until they come"
            self._note(absent[0], text)
        self._say(f"t = 0; speed {self.config.speed:g}")

    def expire(self, now: float) -> None:
        """Make the step that is due, or end the wait that is over."""
        if now < self.until:
            return
        if self.phase == "gathering":
            self._begin(now)
        elif self.phase == "closing":
            self.phase = "over"
        elif self.phase == "running" and self.tick == self._ticks:
            self.close("end of the scenario", now)
        elif self.phase == "running":
            self._keep_pace(now)
            if self.phase == "running":
                self._move()
                self._measure(now)

    def _move(self) -> None:
        """Ask whom the scenario lets leave at this tick to do so, and tell who is to be started."""
        leave, join = self._schedule.take(self.tick)
        for name in leave:
            if name in self.instances:
                reason = f"{name} leaves at t = {self.t:g} s, as the scenario says"
                self.stop(self.keys.dismissal(name, self.instances[name]), reason)
                self._say(reason)
        if join:
            self._say(f"{', '.join(join)} may join from t = {self.t:g} s on, as the scenario says")
            self._report(final=False, awaited=join)

    def _keep_pace(self, now: float) -> None:
        slipped = self.pacer.note(now)
        if slipped:
            text = f"hopelessly late: the schedule was put off by {slipped:.3f} s of wall time"
            self._reporter.note(PlantEvent(t=self.t, kind="warning", subject=PLANT, text=text))
            self._say(text)
        late, of = self.pacer.late, self._ticks
        if self._complained or not (self.pacer.behind if of is None else late > TOLERATED * of):
            return
        self._complained = True
        text = f"cannot keep pace at speed {self.config.speed:g}: {self._pace()}; give it a lower speed or more cores"
        self._reporter.note(PlantEvent(t=self.t, kind="warning", subject=PLANT, text=text))
        self._say(text)
        if self.config.strict:
            self.abort(f"plant: {text}", now)

    def _measure(self, now: float) -> None:
        """Send every agent that is present its measurement, and who is heard."""
        readings, t, tick, incarnation = self.plant.measure(), self.t, self.tick, self.config.incarnation
        roster = tuple(name for name in self.plant.inverters if now - self._heard.get(name, -HEARD) < HEARD)
        for name in self.plates:
            message = measurement_of(name, readings[name], incarnation=incarnation, tick=tick, t=t, roster=roster)
            self._actions.append(Publish(self.keys.measurement(name), encode(message)))
        self._step_due = True

    def work(self, now: float) -> bool:
        """Take the plant one step on, once its measurements are out. Whether anything was done."""
        if not self._step_due:
            return False
        self._step_due = False
        for name, state in self._states.items():
            self.plant.hold(name, state.P_set, state.V_set)
        self._states.clear()
        try:
            self.plant.advance()
        except RuntimeError as error:
            self.cause = error
            self.abort(str(error), now)
            return True
        self.tick += 1
        self._reporter.collect()
        if self.tick % self._telemetry_ticks == 0 or self.tick == 1:
            self._report(final=False)
        return True

    # ---------------------------------------------------------------- what is told

    def _pace(self) -> str:
        return sentence(self.pacer.report(), self.pacer.period)

    def _note(self, subject: str, text: str) -> None:
        self._reporter.note(PlantEvent(t=self.t, kind="roster", subject=subject, text=f"{text}, at t = {self.t:g} s"))
        self._say(f"{text}, at t = {self.t:g} s")

    def _say(self, text: str) -> None:
        self._actions.append(Say(f"plant: {text}"))

    def _report(self, *, final: bool, awaited: tuple[str, ...] = ()) -> None:
        self._reporter.collect()
        messages = self._reporter.report(
            self.t,
            final=final,
            outcome=self.outcome,
            reproducible=False,
            pacing=self.pacer.report(),
            awaited=awaited,
        )
        for message in messages:
            self._actions.append(Publish(self.keys.telemetry, encode(message)))
