"""The plant under real time: the clock decides when it advances. Pure.

Step k is due at start + k T_c / speed. `expire` then measures and publishes to every agent that is present; `work`
holds the set-points heard until then and advances the plant to k + 1: ahead of time, so that what is published at the
next due time is ready. A state thus takes effect at the first step after it came, as it would on a real inverter;
nothing is applied to a time that is past.

**Phases.** *gathering*: until all agents and recorders of the configuration are there, or `wait_for_agents` is over.
*running*. *closing*: the last telemetry is out, and `Stop`, until all tokens are gone. *over*.
"""

from __future__ import annotations

from math import inf

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import LivePlant
from gridpeers.plant.plant_node import CLOSING
from gridpeers.plant.realtime.live_plant_node import AGAIN, LivePlantNode
from gridpeers.plant.realtime.pacer import RealTimePacer
from gridpeers.plant.realtime.run_commands import RunCommands
from gridpeers.plant.telemetry_reporter import measurement_of
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.keys import READING
from gridpeers.wire.links import REPORT_TICKS, Links
from gridpeers.wire.messages import PLANT, Command, PlantEvent, Waiting
from gridpeers.wire.node import ANYBODY, CLOCK_ALONE, Route
from gridpeers.wire.timing import RateLimit, Timer

TELEMETRY = 0.2  # time (s, wall) between two telemetry messages
LINKS = 0.5  # time (s, wall) between two reports on links in a recorded run
LEAD = 0.25  # time (s, wall) from the last agent's nameplate to step 0: the agents are still busy finding each other

RECORDING = 15.0
"""Longest time (s, wall) that an ended run stays for a recorder that has not got all of it: it may have stood still."""

WAITING = 0.5  # time (s, wall) between two messages of a plant that waits for agents to those that are there


COMMANDS, COMMAND_INTERVAL = 100, 0.02
"""Commands of one verb that are carried out at once, and time (s, wall) after which one more is: a step must not wait
for those who ask without end."""


class RealtimePlant(LivePlantNode):
    """The plant under real time; parameters as of `PlantNode`."""

    def __init__(self, config: PlantConfig, plant: LivePlant, links: Links | None = None) -> None:
        if not config.speed > 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        super().__init__(config, plant, links)
        self.pacer = RealTimePacer(config.T_c / config.speed, 0.0)
        self._telemetry_ticks = max(1, round(TELEMETRY / self.pacer.period))
        self._report_ticks = REPORT_TICKS if self.journal is None else max(1, round(LINKS / self.pacer.period))
        """Steps between two reports on the links into the plant."""
        self._step_due = False
        self._next_event_report = -inf
        """Time (s) before which events wait for the next telemetry: many events must not be many messages."""
        self._deadline = 0.0
        self._waiting_timer = Timer(WAITING, 0.0)
        self._warnings = RateLimit(burst=5)
        self._commands = RunCommands(self)
        self._command_limit = RateLimit(burst=COMMANDS, interval=COMMAND_INTERVAL)
        self._stays = False  # whether the end is kept back only for recorders
        self.routes[self.keys.command] = Route(ANYBODY, (Command,), self._on_command)
        self.routes[self.keys.request] = Route(ANYBODY, (Command,), self._on_request)
        self.subscriptions = tuple(self.routes)

    # ---------------------------------------------------------------- what the driver needs

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
        self._say(f"run {self.config.run}: waits up to {self.config.wait_for_agents:g} s for {names}")
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
            self._tell_waiting()
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
        self._say(f"ends: {reason}. {self.pacer}")
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

    # ---------------------------------------------------------------- messages

    def _on_request(self, command: Command, payload: bytes, now: float) -> None:
        if command.verb not in READING:
            raise RejectedError("unexpected", f'"{command.verb}" on the key of those who only read')
        self._on_command(command, payload, now)

    def _on_command(self, command: Command, payload: bytes, now: float) -> None:
        if self._command_limit.admit(command.verb, now) is None:
            raise RejectedError("excess", f'more than {COMMANDS} commands "{command.verb}" at once')
        answer = self._commands.answer(command, now)
        self._publish(self.keys.answer(command.reply_to), encode(answer))
        if answer.ok:
            self._commands.follow_up(command, now)
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
        self._say(f"t = 0; speed {self.config.speed:g}")

    def _tell_waiting(self) -> None:
        waiting = Waiting(sender=PLANT, epoch=self.config.epoch, seq=0, t=self.t, waits_for=self.absent)
        self._publish(self.keys.control, encode(waiting))

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
        heard = self._heard(now)
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
        if self.tick % self._telemetry_ticks == 0 or self.tick == 1 or self._event_is_due(now):
            self._report(final=False)
            self._report_journal()
        if self.tick % self._report_ticks == 0:
            self._report_links()
        return True

    # ---------------------------------------------------------------- events and telemetry

    def _event_is_due(self, now: float) -> bool:
        """Return whether events are to be reported before the next telemetry, so that watchers see them at once."""
        if not self._reporter.has_events or now < self._next_event_report:
            return False
        self._next_event_report = now + TELEMETRY
        return True

    @property
    def events(self) -> tuple[PlantEvent, ...]:
        """The latest events, oldest first."""
        return tuple(self._reporter.latest)

    def note_links(self, text: str) -> None:
        self._note_event("link", "links", text)

    def _warn(self, text: str, now: float) -> None:
        line = self._warnings.admit(text, now)
        if line is not None:
            self._tell_warning(line)

    def _tell_warning(self, text: str) -> None:
        self._note_event("warning", PLANT, text)
        self._say(text)

    def _report(self, *, final: bool, missing_agents: tuple[str, ...] = ()) -> None:
        self._reporter.collect()
        self._send_all(
            self._reporter.report(
                self.t,
                final=final,
                outcome=self.outcome,
                reproducible=False,
                pacing=self.pacer.report(),
                awaited=missing_agents,
                impaired=self.link_commands.impaired(self.t),
                others=self.recorder_feed.kept.others(self._reporter.seq),
            )
        )
