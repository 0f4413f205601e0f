"""The plant in real time: its ticks, and the agents that take part. Pure.

Step k is due at start + k T_c / speed, whatever came until then. At that time the plant measures; then it holds the
set-points that it has heard, and advances ahead of time, so that what is measured at the next due time is ready.

A token and a nameplate: the agent's inverter is put on the network, and measurements are sent to the agent. `Leave`:
its inverter is taken off. A token gone without `Leave`: the agent died, and its inverter stays on primary droop at its
last set-points. An agent that leaves by the scenario is asked to; telemetry names, once, an agent that is to join.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

from gridpeers.plant.meeting import AGAIN, STAYS, Meeting, agent_schedule
from gridpeers.plant.plant_stepper import PlantStepper
from gridpeers.plant.realtime.pacer import RealTimePacer, sentence
from gridpeers.plant.realtime.run_commands import LinkCommandSender
from gridpeers.plant.realtime.silence_detector import SilenceDetector
from gridpeers.plant.recorder_feed import TELEMETRY, RunReports
from gridpeers.wire.links import REPORT_TICKS, Links
from gridpeers.wire.messages import AgentStatus, Leave, LinkAcknowledgement, Pacing, State
from gridpeers.wire.node import CLOCK_ALONE
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Post, Route
from gridpeers.wire.tick_policy import WAIT, TickVerdict
from gridpeers.wire.timing import Awaited, RateLimit

# times in s, real time
LEAD = 0.25  # from the last agent's nameplate to step 0: the agents are still busy finding each other
HEARD = 1.0  # after its last state for which the plant hears an agent
LINKS = 0.5  # between two accounts of links in a recorded run
RECORDING = 13.0  # longest time that an ended run stays for a recorder that has not got all of it


class RealtimeTimer:
    """A tick policy (`gridpeers.wire.tick_policy`): the clock decides."""

    grants, waiting, recording = False, 0.5, RECORDING

    def __init__(self, post: Post, stepper: PlantStepper, phases: Phases) -> None:
        config = stepper.config
        if not config.speed > 0.0:
            raise ValueError(f"speed: must be positive, got {config.speed:g} s/s; 1 is real time")
        self._admission, self._stepper, self._phases, self._config = post.admission, stepper, phases, config
        period = config.T_c / config.speed
        accounts = REPORT_TICKS if post.journal is None else max(1, round(LINKS / period))
        self.report_ticks = max(1, round(TELEMETRY / period)), accounts
        self.pacer = RealTimePacer(period, 0.0)
        self.silence = SilenceDetector(config.max_age, config.T_c, period)
        self.again_at = self._until = 0.0
        self._measured = -1  # the last tick that was measured
        self._heard_at: dict[str, float] = {}  # when the last state of each agent came (s, driver's clock)
        self.warnings = RateLimit(burst=5)

    @property
    def messages_needed(self) -> int:
        return CLOCK_ALONE if self._phases.now == "running" else 1

    @property
    def deadline(self) -> float:
        """When the next step is due, or the present wait is over (s on the driver's clock)."""
        return self.pacer.due if self._phases.now == "running" else min(self._until, self.again_at)

    def pacing(self) -> Pacing:
        return self.pacer.report()

    def start(self, now: float) -> None:
        self._until, self.again_at = now + max(0.0, self._config.wait_for_agents), now

    def begin(self, now: float) -> None:
        """Begin to tick, after a moment."""
        self.pacer, self.again_at = RealTimePacer(self.pacer.period, now + LEAD), now + AGAIN

    def run_time(self, t: float, now: float) -> float:
        return now * self._config.speed

    def due(self, now: float) -> int | None:
        """Return the tick whose measurements are out: the plant advances ahead of time."""
        return self._measured if self._phases.now == "running" and self._measured == self._stepper.tick else None

    def counts(self, state: State, now: float) -> bool:
        """Take a state off the wire; RejectedError if a later one came before."""
        self._admission.take(state)
        self._heard_at[state.sender] = now
        self.silence.heard(state.sender, failed=bool(state.fault))
        return True

    def missing(self) -> tuple[Awaited, ...]:
        return ()

    def passed(self, now: float, unmet: tuple[Awaited, ...] = ()) -> TickVerdict:
        """Judge a deadline: a due tick, whatever is missing, or the end of a wait."""
        if self._phases.now != "running":
            return WAIT if now < self._until else TickVerdict("over")
        if self._stepper.at_end:
            return TickVerdict("tick")
        warnings, slipped, speed = list[str](), self.pacer.note(now), self._config.speed
        if slipped:
            warnings.append(f"fell {slipped:.3f} s of real time behind; all later steps are delayed by as much")
        fails = self.pacer.take_failure(of=self._stepper.end_tick)
        if fails:
            pace = sentence(self.pacing(), self.pacer.period)
            warnings.append(f"cannot keep pace at speed {speed:g}: {pace}; give it a lower speed or more cores")
        told = tuple(line for each in warnings if (line := self.warnings.admit(each, now)) is not None)
        if fails and self._config.strict:
            return TickVerdict("break", f"plant: {warnings[-1]}", told)
        return TickVerdict("tick", warnings=told)

    def measured(self, names: Iterable[str], now: float) -> None:
        """Let the plant advance: the measurements of a tick are out."""
        self._measured = self._stepper.tick

    def heard(self, now: float) -> tuple[str, ...]:
        return tuple(name for name in self._stepper.inverters if now - self._heard_at.get(name, -inf) < HEARD)

    def forget(self, name: str) -> None:
        self.silence.forget(name)
        self._heard_at.pop(name, None)

    def wait_until(self, until: float, again_at: float = inf) -> None:
        self._until, self.again_at = until, again_at


class RealtimeRoster:
    def __init__(self, meeting: Meeting, timer: RealtimeTimer, reports: RunReports, links: Links | None) -> None:
        post, stepper = meeting.post, meeting.stepper
        self._post, self._stepper, self._phases = post, stepper, meeting.phases
        self._meeting, self._timer, self._reports = meeting, timer, reports
        link_commands = self.link_commands = LinkCommandSender(post, links, reports.publish)
        reports.pacing = timer.pacing
        if links is not None:
            reports.impaired = lambda: links.impaired(stepper.t)
        reports.omitted = timer.warnings.left_out
        self.state_keys = post.keys.state, post.keys.set_points
        self.publications = tuple(map(post.keys.link_request, stepper.inverters))
        self._schedule = agent_schedule(stepper.config, stepper.inverters)
        self.everyone = stepper.inverters
        for name in self.everyone:
            keys, routes = post.keys, post.routes
            routes[keys.status(name)] = Route(name, (AgentStatus,), self._on_status, early=True)
            routes[keys.leave(name)] = Route(name, (Leave,), self._on_leave)
            routes[keys.link_acknowledgement(name)] = Route(name, (LinkAcknowledgement,), link_commands.on_answer)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._post.members.nameplates)

    @property
    def absent(self) -> tuple[str, ...]:
        """Agents of the configuration that do not take part."""
        return tuple(name for name in self._stepper.config.agents if name not in self._post.members.nameplates)

    def refusal(self, name: str, instance: str) -> str:
        if name not in self.everyone:
            return f"{name}: no inverter of this name; inverters are {', '.join(self.everyone)}"
        if self._post.members.instance(name) not in ("", instance):
            reason = f"{name}: another agent of this name takes part in run {self._stepper.config.run} already; stop it"
            return f"{reason} first (gridpeers stop {name}), or give this one another name"
        return ""

    def missing(self) -> tuple[Awaited, ...]:
        """Return the tokens and nameplates that the plant waits for before it begins."""
        if self._phases.now != "gathering":
            return ()
        return self._meeting.missing(self._stepper.config.agents, recorders=True)

    def begin(self, now: float) -> None:
        """Begin to tick, with the agents that are here."""
        self._phases.on("begin")
        self._meeting.feed.paced = True
        self._timer.begin(now)
        if absent := self.absent:
            text = f"started without the agents of {', '.join(absent)}, which stay on primary droop until they come"
            self._note(absent[0], text)
        self._post.say(f"t = 0; speed {self._stepper.config.speed:g}")

    def met(self, name: str, now: float) -> None:
        """Let an agent join: its nameplate is here."""
        self._timer.silence.joined(name)
        self._stepper.connect(name, True)
        self._note(name, f"{name} joined")
        self.link_commands.send(self.names, now)

    def died(self, name: str, now: float) -> None:
        self._forget(name)
        self._note(name, f"{name} died; {STAYS}")

    def settle(self, now: float) -> bool:
        """Ask agents to leave, and have agents started, as scheduled for this tick; the plant waits for none."""
        t = self._stepper.t
        actions = self._schedule.pop(self._stepper.tick, [])  # here an agent dies as a process
        for name in [it.inverter for it in actions if it.action == "leave"]:
            if instance := self._post.members.instance(name):
                reason = f"{name} leaves at t = {t:.2f} s, as the scenario says"
                self._meeting.stop(self._post.keys.stop_request(name, instance), reason)
                self._post.say(reason)
        if join := tuple(it.inverter for it in actions if it.action == "join"):
            self._post.say(f"{', '.join(join)} may join from t = {t:.2f} s on, as the scenario says")
            self._reports.telemetry(awaited=join)
        self.link_commands.send(self.names, now)
        return True

    def advanced(self, now: float) -> None:
        """Note which agents fell silent, or are heard again."""
        for name, text in self._timer.silence.take(now):
            self._note(name, text)

    def ask_again(self) -> None:
        """Ask for the nameplates that are missing."""
        self._post.ask_again()

    def _forget(self, name: str) -> None:
        self.link_commands.forget(name)
        self._timer.forget(name)

    def _note(self, subject: str, text: str) -> None:
        text = f"{text}, at t = {self._stepper.t:.2f} s"
        self._stepper.note("roster", subject, text)
        self._post.say(text)

    def _on_status(self, status: AgentStatus, payload: bytes, now: float) -> None:
        if status.sender in self._post.members.nameplates:  # one comes before its nameplate now and then
            self._post.admission.check(status)
            self._timer.silence.reported(status)

    def _on_leave(self, leave: Leave, payload: bytes, now: float) -> None:
        name = leave.sender
        instance = self._post.members.instance(name)
        self._meeting.stop(self._post.keys.stop_request(name, instance), f"{name} has left")
        self._post.process_gone(name, instance)
        self._forget(name)
        if self._phases.allows("end"):
            self._stepper.connect(name, False)
            self._note(name, f"{name} left; its inverter is off the network")
