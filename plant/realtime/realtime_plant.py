"""The plant under real time: the clock decides when it advances; agents and recorders come and go. Pure.

Step k is due at start + k T_c / speed. `expire` then measures and publishes to every agent that is present; `work`
holds the set-points heard until then and advances the plant to k + 1: ahead of time, so that what is published at the
next due time is ready. A state thus takes effect at the first step after it came, as it would on a real inverter.

A token and a nameplate: the agent's inverter is put on the network, and measurements are sent to the agent. `Leave`:
its inverter is taken off. A token gone without `Leave`: the agent died, and its inverter stays on primary droop at its
last set-points. An agent that leaves by the scenario is asked to; telemetry names, once, an agent that is to join.

**Phases.** *gathering*: until all agents and recorders of the configuration are there, or `wait_for_agents` is over.
*running*. *closing*: the last telemetry is out, and `Stop`, until all tokens are gone. *over*.
"""

from __future__ import annotations

from functools import partial
from math import inf
from typing import Literal

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import LivePlant
from gridpeers.plant.plant_node import CLOSING, STAYS, PlantNode, TickActions
from gridpeers.plant.realtime import run_commands
from gridpeers.plant.realtime.pacer import RealTimePacer
from gridpeers.plant.realtime.recorder_feed import KEPT_BYTES, KEPT_BYTES_RECORDED, RecorderFeed
from gridpeers.plant.realtime.run_commands import LinkCommandSender
from gridpeers.plant.realtime.silence_detector import SilenceDetector
from gridpeers.plant.telemetry_reporter import measurement_of
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.journal import TimedTraffic
from gridpeers.wire.keys import READING
from gridpeers.wire.links import REPORT_TICKS, Links
from gridpeers.wire.membership import is_usable
from gridpeers.wire.messages import (
    PLANT,
    AgentStatus,
    Command,
    Journal,
    Leave,
    LinkAcknowledgement,
    LinkReport,
    Nameplate,
    PlantEvent,
    State,
    Waiting,
)
from gridpeers.wire.node import CLOCK_ALONE
from gridpeers.wire.post import ANYBODY, Route
from gridpeers.wire.timing import RateLimit, Timer

Phase = Literal["gathering", "running", "closing", "over"]

# times in s, wall
TELEMETRY = 0.2  # between two telemetry messages
LINKS = 0.5  # between two reports on links in a recorded run
LEAD = 0.25  # from the last agent's nameplate to step 0: the agents are still busy finding each other
RECORDING = 15.0  # longest time that an ended run stays for a recorder that has not got all of it
WAITING = 0.5  # between two messages of a plant that waits for agents to those that are there
AGAIN = 1.0  # between two questions for the nameplates that have not come: a question dies with its link
HEARD = 1.0  # after its last state for which an agent is on the roster, as one that the plant hears
COMMANDS, COMMAND_INTERVAL = 100, 0.02
"""Commands of one verb that are carried out at once, and time after which one more is: a step must not wait for those
who ask without end."""

REFUSALS, REFUSAL_INTERVAL = 20, 0.1
"""Refused processes that are logged and told at once, and time after which one more is told: each needs a publisher of
its own, a millisecond or two in which the plant does not step."""


class RealtimePlant(PlantNode):
    def __init__(self, config: PlantConfig, plant: LivePlant, links: Links | None = None) -> None:
        if not config.speed > 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        super().__init__(config, plant, links)
        keys, recorded = self.keys, self.post.journal is not None
        self.phase: Phase = "gathering"
        self.plant = plant
        self.pacer = RealTimePacer(config.T_c / config.speed, 0.0)
        self.link_commands = LinkCommandSender(config.epoch, keys, links, self._publish)
        publish = partial(self.post.publish, keys.telemetry)
        self.recorder_feed = RecorderFeed(config.recorders, publish, KEPT_BYTES_RECORDED if recorded else KEPT_BYTES)
        self._telemetry_ticks = max(1, round(TELEMETRY / self.pacer.period))
        self._report_ticks = max(1, round(LINKS / self.pacer.period)) if recorded else REPORT_TICKS
        self._step_due = False
        self._next_event_report = -inf  # until then (s) events wait for the next telemetry: they must not be a flood
        self._deadline = 0.0
        self._states: dict[str, State] = {}  # states that the links let through and that are not held yet
        self._state_at: dict[str, float] = {}  # when the last state of each agent came (s, driver's clock)
        self._silence = SilenceDetector(config.max_age, config.T_c, self.pacer.period)
        self._waiting_timer, self._ask_timer = Timer(WAITING, 0.0), Timer(AGAIN, 0.0)
        self._refusals = 0
        self._refusal_limit = RateLimit(REFUSALS, REFUSAL_INTERVAL)
        self._warnings = RateLimit(burst=5)
        self._command_limit = RateLimit(burst=COMMANDS, interval=COMMAND_INTERVAL)
        self._stays = False  # whether the end is kept back only for recorders
        self.timed: TimedTraffic | None = None  # notes the plant's messages and tokens; None if nobody records them
        if self.post.journal is not None:
            arrivals = config.record == "all"
            self.timed = self.post.traffic = TimedTraffic(keys, self.post.journal, arrivals=arrivals, whole=True)
        for name in plant.inverters:
            self.routes[keys.state(name)] = self.routes[keys.set_points(name)] = Route(name, (State,), self._on_state)
            self.routes[keys.status(name)] = Route(name, (AgentStatus,), self._on_status, early=True)
            self.routes[keys.leave(name)] = Route(name, (Leave,), self._on_leave)
            self.routes[keys.report(name)] = Route(name, (LinkReport,), self._on_report)
            self.routes[keys.journal(name)] = Route(name, (Journal,), self._on_journal)
            self.routes[keys.link_acknowledgement(name)] = Route(name, (LinkAcknowledgement,), self._on_link_answer)
        self.routes[keys.command] = Route(ANYBODY, (Command,), self._on_command)
        self.routes[keys.request] = Route(ANYBODY, (Command,), self._on_request)
        self.subscriptions = tuple(self.routes)

    # ---------------------------------------------------------------- what the driver needs

    @property
    def publications(self) -> tuple[str, ...]:
        inverters = self.plant.inverters
        each = (*map(self.keys.measurement, inverters), *map(self.keys.link_request, inverters))
        return self.keys.control, self.keys.telemetry, *each

    @property
    def finished(self) -> bool:
        return self.phase == "over"

    @property
    def messages_needed(self) -> int:
        return CLOCK_ALONE if self.phase == "running" else 1

    @property
    def deadline(self) -> float:
        """When the next step is due, or the present wait is over (s on the driver's clock)."""
        if self.phase == "running":
            return self.pacer.due
        return min(self._deadline, self._waiting_timer.due) if self.phase == "gathering" else self._deadline

    def start(self, now: float) -> None:
        if self.timed is not None:
            self.timed.process("start", f"run {self.config.run}, epoch {self.config.epoch}", now)
        self._deadline = now + max(0.0, self.config.wait_for_agents)
        self._waiting_timer, self._ask_timer = Timer(WAITING, now), Timer(AGAIN, now + AGAIN)
        self._reporter.collect()
        names = ", ".join(self.config.agents) or "nobody"
        self.post.say(f"run {self.config.run}: waits up to {self.config.wait_for_agents:g} s for {names}")
        self._gather(now)

    def expire(self, now: float) -> None:
        if now < self.deadline:
            return
        if self.timed is not None:
            self.timed.woken(now)
        if self.phase == "gathering" and now >= self._deadline:
            self._begin(now)
        elif self.phase == "gathering":
            self._waiting_timer.take(now)
            waiting = Waiting(sender=PLANT, epoch=self.config.epoch, seq=0, t=self.t, waits_for=self.absent)
            self._publish(self.keys.control, encode(waiting))
            self._ask_again(now)
        elif self.phase == "closing":
            self._send_the_last()
            if self._stays or not self.recorder_feed.awaits(self._recorders):
                self.phase = "over"
            else:
                self._stays, self._deadline = True, now + RECORDING - CLOSING
        elif self.phase == "running" and self.tick == self._end_tick:
            self.close("end of the scenario", now)
        elif self.phase == "running":
            self._keep_pace(now)
            if self.phase == "running":
                self._let_leave_and_join()
                self.link_commands.send(self.members.nameplates, now)
                self._measure(now)
                self._ask_again(now)

    # ---------------------------------------------------------------- the end

    def abort(self, reason: str, now: float) -> None:
        if self.phase not in ("closing", "over"):
            self.outcome = reason
            self.close(reason, now)

    def interrupt(self, reason: str, now: float) -> None:
        """Leave the run, which another plant may take up again: the agents are not told to close."""
        if self.phase not in ("closing", "over"):
            self.outcome = reason
            self._report(final=True)
            self.phase = "over"
            self.recorder_feed.end()

    def close(self, reason: str, now: float) -> None:
        for line in self._warnings.left_out():
            self._tell_warning(line)
        self.post.say(f"ends: {reason}. {self.pacer}")
        self._tell_the_end(reason)
        self.phase = "closing"
        self.recorder_feed.end()
        self._deadline = now + CLOSING
        if self._all_have_gone():
            self.phase = "over"

    def _all_have_gone(self) -> bool:
        return super()._all_have_gone() and self.recorder_feed.complete

    def _close_if_alone(self) -> None:
        feed, present = self.recorder_feed, self._recorders
        if self.phase == "closing" and (self._all_have_gone() or (self._stays and not feed.awaits(present))):
            self.phase = "over"

    # ---------------------------------------------------------------- tokens and nameplates

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared; an agent that comes after the end has missed the `Stop` to all."""
        match self.keys.parts(key):
            case ("alive", "agent", name, instance) if self.phase == "closing":
                if self._may_tell(name, instance, now):
                    self._tokens.add(key)
                    self.stop(self.keys.stop_request(name, instance), self.outcome or "the run has ended")
            case _:
                super().appeared(key, now)

    def _refusal(self, name: str, instance: str) -> str:
        if name not in self.plant.inverters:
            return f"{name}: no inverter of this name; inverters are {', '.join(self.plant.inverters)}"
        if self._is_taken(name, instance):
            reason = f"{name}: another agent of this name takes part in run {self.config.run} already; stop it"
            return f"{reason} first (gridpeers stop {name}), or give this one another name"
        return ""

    def _refuse(self, name: str, instance: str, reason: str, now: float) -> None:
        if not self._may_tell(name, instance, now):
            return
        self._refusals += 1
        if self._refusals <= REFUSALS:
            self.post.say(f"refused {reason}" + ("; further refusals are not logged" * (self._refusals == REFUSALS)))
        super()._refuse(name, instance, reason, now)

    def _may_tell(self, name: str, instance: str, now: float) -> bool:
        """Return whether a process is told that it cannot take part; count it if too many are."""
        if self._refusal_limit.admit("refused", now) is not None:
            return True
        text = f"a token of {name}, one of too many to be told that they are refused"
        self.rejects.add("excess", self.keys.alive_agent(name, instance), text)
        return False

    def _ask_again(self, now: float) -> None:
        if now >= self._ask_timer.due:
            self._ask_timer.take(now)
            self.post.ask_again()

    def _recorder_came(self, name: str, now: float) -> None:
        if news := self.recorder_feed.came(name):
            self.post.say(news)
        self._gather(now)

    def _recorder_gone(self, name: str) -> None:
        if self.phase == "running" and (news := self.recorder_feed.gone(name)):
            self.post.say(news)

    def _met(self, nameplate: Nameplate, now: float) -> None:
        name = nameplate.sender
        if self.phase not in ("gathering", "running"):
            return
        self._silence.joined(name)
        self._connect(name, True, now)
        self._note(name, f"{name} joined")
        self.link_commands.send(self.members.nameplates, now)
        self._gather(now)

    def _agent_gone(self, name: str, now: float) -> None:
        self._forget(name)
        if self.phase in ("gathering", "running"):
            self._note(name, f"{name} died; {STAYS}")

    def _forget(self, name: str) -> None:
        self.link_commands.forget(name)
        self._silence.forget(name)
        self._state_at.pop(name, None)
        self._states.pop(name, None)

    @property
    def absent(self) -> tuple[str, ...]:
        """Agents of the configuration that do not take part."""
        return tuple(name for name in self.config.agents if name not in self.members.nameplates)

    def _gather(self, now: float) -> None:
        if self.phase == "gathering" and not self.absent and self._recorders >= set(self.config.recorders):
            self._begin(now)

    def _connect(self, name: str, on: bool, now: float) -> None:
        self._operate(lambda: self.plant.connect(name, on), now)

    def _let_leave_and_join(self) -> None:
        leave, join, _ = self._schedule.pop(self.tick, TickActions())  # in real time an agent dies as a process
        for name in leave:
            if instance := self.members.instance(name):
                reason = f"{name} leaves at t = {self.t:.2f} s, as the scenario says"
                self.stop(self.keys.stop_request(name, instance), reason)
                self.post.say(reason)
        if join:
            self.post.say(f"{', '.join(join)} may join from t = {self.t:.2f} s on, as the scenario says")
            self._report(final=False, missing_agents=join)

    # ---------------------------------------------------------------- messages

    def _on_state(self, state: State, payload: bytes, now: float) -> None:
        self.admission.take(state)
        self._state_at[state.sender] = now
        self._silence.heard(state.sender, failed=bool(state.fault))
        self._note_state(state)
        if is_usable(self._links, state, payload, now * self.config.speed, self.admission):
            self._states[state.sender] = state

    def _on_status(self, status: AgentStatus, payload: bytes, now: float) -> None:
        if status.sender in self.members.nameplates:  # one comes before its nameplate now and then
            self.admission.check(status)
            self._silence.reported(status)

    def _on_link_answer(self, answer: LinkAcknowledgement, payload: bytes, now: float) -> None:
        self.link_commands.answered(answer)

    def _on_leave(self, leave: Leave, payload: bytes, now: float) -> None:
        name = leave.sender
        instance = self.members.instance(name)
        self.stop(self.keys.stop_request(name, instance), f"{name} has left")
        self.post.process_gone(name, instance)
        self._forget(name)
        if self.phase in ("gathering", "running"):
            self._connect(name, False, now)
            self._note(name, f"{name} left; its inverter is off the network")

    def _on_request(self, command: Command, payload: bytes, now: float) -> None:
        if command.verb not in READING:
            raise RejectedError("unexpected", f'"{command.verb}" on the key of those who only read')
        self._on_command(command, payload, now)

    def _on_command(self, command: Command, payload: bytes, now: float) -> None:
        if self._command_limit.admit(command.verb, now) is None:
            raise RejectedError("excess", f'more than {COMMANDS} commands "{command.verb}" at once')
        answer = run_commands.answer(self, command, now)
        self._publish(self.keys.answer(command.reply_to), encode(answer))
        if answer.ok:
            run_commands.follow_up(self, command, now)
        if command.verb == "telemetry" and self.phase != "running":
            self.recorder_feed.replay()

    # ---------------------------------------------------------------- steps

    def _begin(self, now: float) -> None:
        self.phase = "running"
        self.recorder_feed.paced = True
        self.pacer = RealTimePacer(self.pacer.period, now + LEAD)
        if absent := self.absent:
            text = f"started without the agents of {', '.join(absent)}, which stay on primary droop until they come"
            self._note(absent[0], text)
        self.post.say(f"t = 0; speed {self.config.speed:g}")

    def _keep_pace(self, now: float) -> None:
        slipped = self.pacer.note(now)
        if slipped:
            self._warn(f"fell {slipped:.3f} s of wall time behind; all later steps are put off by as much", now)
        if not self.pacer.take_failure(of=self._end_tick):
            return
        speed = self.config.speed
        text = f"cannot keep pace at speed {speed:g}: {self.pacer}; give it a lower speed or more cores"
        self._warn(text, now)
        if self.config.strict:
            self.abort(f"plant: {text}", now)

    def _measure(self, now: float) -> None:
        """Send every agent that is present its measurement, with the names of the agents that the plant hears."""
        readings, t, tick, epoch = self.plant.measure(), self.t, self.tick, self.config.epoch
        heard = tuple(name for name in self.plant.inverters if now - self._state_at.get(name, -inf) < HEARD)
        for name in self.members.nameplates:
            message = measurement_of(name, readings[name], epoch=epoch, tick=tick, t=t, roster=heard)
            self._publish(self.keys.measurement(name), encode(message))
        self._step_due = True

    def work(self, now: float) -> bool:
        """Take the plant one step on, once its measurements are out; return whether it did."""
        if not self._step_due:
            return False
        self._step_due = False
        if self.timed is not None:
            self.timed.woken(now, work=True)
        if self._stops_for_a_law(now):
            return True
        self.recorder_feed.replay()
        self._states.update((state.sender, state) for state in self._late_states(now * self.config.speed))
        states, self._states = self._states, {}
        for state in states.values():
            self.plant.hold(state.sender, state.P_set, state.V_set)
        if not self._operate(self.plant.advance, now):
            return True
        self.tick += 1
        for name, text in self._silence.take(now):
            self._note(name, text)
        self._reporter.collect()
        self._note_node_faults()
        due = self.tick % self._telemetry_ticks == 0 or self.tick == 1
        if not due and self._reporter.has_events and now >= self._next_event_report:  # watchers see events at once
            due, self._next_event_report = True, now + TELEMETRY
        if due:
            self._report(final=False)
            self._report_journal()
        if self.tick % self._report_ticks == 0:
            self._report_links()
        return True

    # ---------------------------------------------------------------- events and telemetry

    @property
    def events(self) -> tuple[PlantEvent, ...]:
        """The latest events, oldest first."""
        return tuple(self._reporter.latest)

    def note_links(self, text: str) -> None:
        self._note_event("link", "links", text)

    def _note(self, subject: str, text: str) -> None:
        self._note_event("roster", subject, f"{text}, at t = {self.t:.2f} s")
        self.post.say(f"{text}, at t = {self.t:.2f} s")

    def _warn(self, text: str, now: float) -> None:
        line = self._warnings.admit(text, now)
        if line is not None:
            self._tell_warning(line)

    def _tell_warning(self, text: str) -> None:
        self._note_event("warning", PLANT, text)
        self.post.say(text)

    def _publish(self, key: str, payload: bytes) -> None:
        if key == self.keys.telemetry:
            self.recorder_feed.publish(self._reporter.seq, payload)
        else:
            super()._publish(key, payload)

    def _report(self, *, final: bool, missing_agents: tuple[str, ...] = ()) -> None:
        self._reporter.collect()
        messages = self._reporter.report(
            self.t,
            final=final,
            outcome=self.outcome,
            reproducible=False,
            pacing=self.pacer.report(),
            awaited=missing_agents,
            impaired=self.link_commands.impaired(self.t),
            others=self.recorder_feed.others(self._reporter.seq),
        )
        for message in messages:
            self._send(message)
