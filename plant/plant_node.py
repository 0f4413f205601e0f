"""The plant of a run as a node: it meets agents, measures for them, holds their set-points, and advances. Pure.

It is the same in simulated and in real time. A tick policy decides when it ticks: `LockstepBarrier` once the whole
roster has sent its states, `RealtimeTimer` by the clock. A roster has the agents that take part: `LockstepRoster`
changes only between two ticks, `RealtimeRoster` at once.

*gathering*: until all agents and recorders of the configuration are there; in real time no longer than
`wait_for_agents`. *preparing*, *joining*: the roster changes (`gridpeers.plant.lockstep`). *running*: from a
measurement to the next one. *holding*: between two ticks of simulated time, while much telemetry has no
acknowledgement of a recorder. It has no deadline, so the plant waits for a stopped recorder. *closing*: from `Stop`,
until all tokens are gone, as proof that every node has heard it. *recording*: until recorders have all. *over*.

What may be lost is asked again: for nameplates, and by the same `Prepare` for each `Ready`.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from math import inf
from typing import Protocol, cast

from gridpeers.plant.lockstep import LockstepBarrier, LockstepRoster
from gridpeers.plant.meeting import AGAIN, Meeting
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import LivePlant, PlantLike
from gridpeers.plant.plant_stepper import PlantStepper
from gridpeers.plant.realtime.pacer import sentence
from gridpeers.plant.realtime.realtime import RealtimeRoster, RealtimeTimer
from gridpeers.plant.realtime.run_commands import RunCommands
from gridpeers.plant.recorder_feed import KEPT_BYTES, KEPT_BYTES_RECORDED, RecorderFeed, RunReports
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.journal import JournalBuffer, TickTraffic, Traffic
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, Answer, Command, Journal, LinkReport, Nameplate, State, Waiting
from gridpeers.wire.phases import Phases, PhaseTable
from gridpeers.wire.post import ANYBODY, Post, Route
from gridpeers.wire.tick_policy import TickPolicy
from gridpeers.wire.timing import Awaited

PHASES: PhaseTable = {
    "gathering": {"prepare": "preparing", "begin": "running", "end": "closing", "leave": "over"},
    "preparing": {"prepare": "preparing", "tick": "running", "hold": "holding", "end": "closing"},
    "running": {
        "tick": "running",
        "prepare": "preparing",
        "join": "joining",
        "hold": "holding",
        "end": "closing",
        "leave": "over",
    },
    "joining": {"prepare": "preparing", "end": "closing"},
    "holding": {"prepare": "preparing", "tick": "running", "end": "closing"},
    "closing": {"record": "recording", "gone": "over"},
    "recording": {"gone": "over"},
    "over": {},
}

CLOSING = 2.0  # longest wait (s) for the other nodes to close


class PlantTickPolicy(TickPolicy, Protocol):
    """Tick policy of a plant, with the further questions of its node."""

    again_at: float  # when open questions are asked again (s on the driver's clock)

    @property
    def waiting(self) -> float:
        """Time (s) between two messages of a plant that waits to the agents that are there."""

    @property
    def recording(self) -> float:
        """Time (s) for which an ended run stays for a recorder."""

    def heard(self, now: float) -> tuple[str, ...] | None:
        """Return the agents that the plant hears; None if they know that from the roster."""

    def measured(self, names: Iterable[str], now: float) -> None:
        """Note that the measurements of a tick are out to these agents."""

    def wait_until(self, until: float, again_at: float = inf) -> None:
        """Wait for no message, until a time (s)."""


class PlantNode:
    """ValueError if the configuration and the plant do not fit."""

    def __init__(self, config: PlantConfig, plant: PlantLike, links: Links | None = None) -> None:
        post = self.post = Post(PLANT, config.run, config.epoch)
        if config.record != "physics":
            post.journal = JournalBuffer()
        keys = self.keys = post.keys
        self.config, self.links = config, links
        self.name, self.members, self.rejects, self.routes = PLANT, post.members, post.rejects, post.routes
        self.token, self.watched = keys.alive_plant(config.epoch), keys.any_alive
        self.tokens = (self.token,)
        self.received, self.lost = post.received, post.lost
        self.take_actions, self.take_rejects = post.take_actions, post.take_rejects
        post.on_nameplate = self._on_nameplate
        realtime = config.clock == "realtime"
        stepper = self.stepper = PlantStepper(config, plant)
        phases = self._phases = Phases(PHASES)
        kept = None if not realtime else KEPT_BYTES if post.journal is None else KEPT_BYTES_RECORDED
        feed = self.feed = RecorderFeed(config.recorders, partial(post.publish, keys.telemetry), kept)
        self.meeting = Meeting(post, stepper, phases, feed)
        self.ticks: PlantTickPolicy
        self.roster: LockstepRoster | RealtimeRoster
        self._states: dict[str, State] = {}  # states that the links let through and that are not held yet
        self._tick_traffic: TickTraffic | None = None
        self._timed: Traffic | None = None
        if realtime:
            self.ticks = timer = RealtimeTimer(post, stepper, phases)
            self.reports = RunReports(post, stepper, feed, timer.report_ticks, live=True)
            self.roster = roster = RealtimeRoster(self.meeting, timer, self.reports, links)
            RunCommands(self, cast(LivePlant, plant), timer, roster.link_commands)
            if post.journal is not None:
                arrivals = config.record == "all"
                post.traffic = self._timed = Traffic(keys, post.journal, arrivals=arrivals, whole=True)
        else:
            self.ticks = barrier = LockstepBarrier(post, stepper, phases, feed)
            self.reports = RunReports(post, stepper, feed, barrier.report_ticks, live=False)
            self.roster = LockstepRoster(self.meeting, barrier, self.reports)
            post.routes[keys.request] = Route(ANYBODY, (Command,), self._on_request)
            if post.journal is not None:
                post.traffic = self._tick_traffic = TickTraffic(keys, self.roster.everyone, post.journal)
        for name in self.roster.everyone:
            for key in self.roster.state_keys:
                post.routes[key(name)] = Route(name, (State,), self._on_state)
            post.routes[keys.report(name)] = Route(name, (LinkReport,), self._on_report)
            post.routes[keys.journal(name)] = Route(name, (Journal,), self._on_report)
        self.subscriptions = tuple(post.routes)
        self._measurement_keys = {name: keys.measurement(name) for name in self.roster.everyone}
        self.publications = keys.control, keys.telemetry, *self._measurement_keys.values(), *self.roster.publications

    @property
    def phase(self) -> str:
        return self._phases.now

    @property
    def finished(self) -> bool:
        return self._phases.now == "over"

    @property
    def messages_needed(self) -> int:
        return self.ticks.messages_needed

    @property
    def deadline(self) -> float | None:
        return self.ticks.deadline

    def missing_messages(self) -> tuple[Awaited, ...]:
        """Return the messages and tokens that the plant waits for, and their senders."""
        return self.roster.missing() or self.ticks.missing()

    # ---------------------------------------------------------------- what the driver calls

    def start(self, now: float) -> None:
        config = self.config
        if self._timed is not None:
            self._timed.process("start", f"run {config.run}, epoch {config.epoch}", now)
        self.stepper.collect()
        self.ticks.start(now)
        if not self.ticks.grants:
            names = ", ".join(config.agents) or "nobody"
            self.post.say(f"run {config.run}: waits up to {config.wait_for_agents:g} s for {names}")
        self._gather(now)

    def appeared(self, key: str, now: float) -> None:
        self.meeting.appeared(key, now, self.roster.refusal)
        self._gather(now)

    def vanished(self, key: str, now: float) -> None:
        name = self.meeting.vanished(key, now)
        if name and self._phases.allows("end"):
            self.roster.died(name, now)
            self._break_if_broken(now)
        self._close_if_alone(now)

    def work(self, now: float) -> bool:
        """Advance the plant, or go on to the next tick, if nothing is missing; return whether it did anything."""
        if self.ticks.due(now) is None:
            return False
        if self._timed is not None:
            self._timed.woken(now, work=True)
        if self.phase == "running":
            self._advance(now)
        elif (self.phase == "joining" and self.missing_messages()) or (self.phase == "holding" and self.feed.is_full):
            return False
        if self.ticks.grants:
            self._go_on(now)
        return True

    def expire(self, now: float) -> None:
        deadline = self.deadline
        if deadline is None or now < deadline:
            return
        if self._timed is not None:
            self._timed.woken(now)
        verdict = self.ticks.passed(now, self.roster.missing())
        self._warn(verdict.warnings)
        if verdict.kind == "break":
            self.abort(verdict.reason, now)
        elif verdict.kind == "tick":
            self._go_on(now)
        elif verdict.kind == "over" and self.phase == "gathering":
            self.roster.begin(now)
        elif verdict.kind == "over":
            self._close_if_alone(now, waited=True)
        if now >= self.ticks.again_at and self._phases.allows("end"):
            self._ask_again(now)

    def abort(self, reason: str, now: float) -> None:
        """Break the run, unless it ends already."""
        if self._phases.allows("end"):
            self.stepper.outcome, self.stepper.reproducible = reason, False
            self.close(reason, now)

    def interrupt(self, reason: str, now: float) -> None:
        """Leave the run; in real time another plant may take it up, so the agents are not told to close."""
        if self.ticks.grants:
            self.abort(reason, now)
        elif self._phases.allows("leave"):
            self.stepper.outcome = reason
            self.reports.telemetry(final=True)
            self._phases.on("leave")
            self.post.closed = True
            self.feed.end()

    def _warn(self, texts: Iterable[str]) -> None:
        for text in texts:
            self.stepper.note("warning", PLANT, text)
            self.post.say(text)

    def _break_if_broken(self, now: float) -> None:
        if self.stepper.broken:
            self.abort(self.stepper.broken, now)

    # ---------------------------------------------------------------- the agents

    def _gather(self, now: float) -> None:
        """Begin once all agents and recorders of the configuration are here."""
        enough = len(self.members.nameplates) >= len(self.config.agents)  # else it would ask n times for all n
        if self.phase == "gathering" and enough and not self.roster.missing():
            self.roster.begin(now)

    def _on_nameplate(self, instance: str, nameplate: Nameplate, first: bool, now: float) -> None:
        if first and self._phases.allows("end"):
            self.roster.met(nameplate.sender, now)
            self._break_if_broken(now)
            self._gather(now)

    def _on_state(self, state: State, payload: bytes, now: float) -> None:
        if not self.ticks.counts(state, now):
            tick = self.stepper.tick
            kind = "stale" if state.seq <= tick else "unexpected"
            raise RejectedError(kind, f"State({state.seq}) of {state.sender} at tick {tick} ({self.phase})")
        if state.fault or state.quiet:
            self.stepper.hear(state)
        at = self.ticks.run_time(state.t, now)
        if self.post.admission.is_usable(self.links, state, payload, at):
            self._states[state.sender] = state

    def _on_report(self, report: LinkReport | Journal, payload: bytes, now: float) -> None:
        """Pass on an agent's report for the record; acknowledge the last account of its links, so that it closes."""
        self.reports.publish(payload)
        if isinstance(report, LinkReport) and report.final:
            self.meeting.stop(self.keys.stop_request(report.sender, report.instance), "its report is here")

    def _on_request(self, command: Command, payload: bytes, now: float) -> None:
        """Take a recorder's word on which Telemetry it needs next; publish again if it says the same once more."""
        name, text = command.sender, command.argument
        known = command.verb == "telemetry" and name in self.config.recorders and text.isascii() and text.isdigit()
        if not known:
            raise RejectedError("unexpected", f'"{command.verb}" of {name}, in simulated time')
        self.post.last_heard[name] = command.seq, now
        if not self.feed.acknowledged(name, int(text), now):
            first, t = self.feed.again_from(int(text)), self.stepper.t
            answer = Answer(sender=PLANT, epoch=self.post.epoch, seq=command.seq, t=t, ok=True, text=str(first))
            self.reports.publish_aside(self.keys.answer(command.reply_to), answer)
            self.feed.replay()
        self._close_if_alone(now)

    def _ask_again(self, now: float) -> None:
        waits = self.phase in ("gathering", "joining", "holding")
        self.ticks.again_at = now + (self.ticks.waiting if waits else AGAIN)
        self.roster.ask_again()
        if waits:
            names = tuple(dict.fromkeys(who for _, who in self.roster.missing())) or self.config.recorders
            tick, t, epoch = self.stepper.tick, self.stepper.t, self.post.epoch
            waiting = Waiting(sender=PLANT, epoch=epoch, seq=tick, t=t, waits_for=names)
            self.reports.publish_aside(self.keys.control, waiting)

    # ---------------------------------------------------------------- ticks

    def _go_on(self, now: float) -> None:
        """Measure, once the roster of this tick is settled; or end the run."""
        stepper = self.stepper
        if not self._phases.allows("end"):
            return
        if stepper.at_end:
            self.close("end of the scenario", now)
            return
        settled = self.roster.settle(now)
        self._break_if_broken(now)
        if not settled or not self._phases.allows("tick"):
            return
        if self.feed.is_full:
            self._phases.on("hold")
            self.ticks.wait_until(inf, now + AGAIN)
            return
        self._phases.on("tick")
        names = self.roster.names
        self.ticks.measured(names, now)
        for measurement in stepper.measurements(names, self.ticks.heard(now)):
            self.post.publish(self._measurement_keys[measurement.to], encode(measurement))
        if stepper.tick == 0 and self.ticks.grants:
            stepper.collect(self.links)
            self.reports.telemetry()

    def _advance(self, now: float) -> None:
        """Hold the set-points that came, and go one tick on."""
        stepper = self.stepper
        if why := stepper.broken or stepper.law_failure():
            self.abort(why, now)
            return
        if self._tick_traffic is not None:
            self._tick_traffic.ticked(stepper.tick)
        self.feed.replay()
        states, self._states = self._states, {}
        at = self.ticks.run_time(stepper.t, now)
        for late in self.post.admission.arrived(self.links, at, self.rejects):
            if isinstance(late, State):
                states[late.sender] = late
        hold, epochs = stepper.plant.hold, self.post.admission.epochs
        for name in self.roster.names:
            if (state := states.get(name)) is not None and state.epoch == epochs.get(name):
                hold(name, state.P_set, state.V_set)
        if not stepper.advance():
            self.abort(stepper.broken, now)
            return
        self.roster.advanced(now)
        stepper.collect(self.links)
        if not (stepper.at_end and self.ticks.grants):  # else the last telemetry follows
            self.reports.regular(now, self.links)

    # ---------------------------------------------------------------- the end

    def close(self, reason: str, now: float) -> None:
        """End the run: tell all nodes to close, and report once they have."""
        self._warn(self.reports.omitted())
        if pacing := self.reports.pacing():
            self.post.say(f"ends: {reason}. {sentence(pacing, self.config.T_c / self.config.speed)}")
        if self._tick_traffic is not None:
            self._tick_traffic.ticked(self.stepper.tick)
        self.reports.last_due = True
        if self.links is None and self._timed is None:  # else once agents have sent their accounts and journals
            self.reports.last(self.links)
        self.meeting.stop(self.keys.control, reason)
        self._phases.on("end")
        self.feed.end()
        self.ticks.wait_until(now + CLOSING)
        self._close_if_alone(now)

    def _close_if_alone(self, now: float, *, waited: bool = False) -> None:
        """Be over once all have gone and recorders have all; `waited`: agents, then recorders, had their time."""
        phase = self.phase
        if phase not in ("closing", "recording"):
            return
        if waited or not self.meeting.has_agents:
            self.reports.last(self.links)
        serves = self.feed.serves(self.meeting.recorders)
        if waited and serves and phase == "closing":
            self._phases.on("record")
            self.ticks.wait_until(now + self.ticks.recording)
        elif waited or not (serves or (phase == "closing" and not self.meeting.is_alone)):
            self._phases.on("gone")
            self.post.closed = True
            self.ticks.wait_until(inf)
