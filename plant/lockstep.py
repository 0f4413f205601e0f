"""The plant in simulated time: its ticks, and the roster of each. Pure.

Measurement(k) grants tick k, and the plant advances to k + 1 when it has State(k) of every agent on the roster. Each
wait has a deadline, and names the agents that are missing. `now` (s on the driver's clock) serves deadlines only.

The roster changes between two ticks alone: from `Prepare` with a roster until every agent on it is `Ready`, and before
a join until the scheduled newcomers have a token and a nameplate; telemetry names them, once, as awaited. Because the
tick is held, no number depends on how long a process took to start.

At a scheduled leave the plant sends the agent a stop request and disconnects its inverter; at a join it connects the
inverter at no load. At a scheduled death it sends the stop request, but the inverter stays. When an agent dies by
itself, the plant removes it from the roster and the run continues, marked not reproducible; a death before tick 0
ends the run, because it would be another run.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

from gridpeers.plant.meeting import AGAIN, STAYS, Meeting, agent_schedule
from gridpeers.plant.plant_config import ScheduledAction
from gridpeers.plant.plant_stepper import TELEMETRY_TICKS, PlantStepper
from gridpeers.plant.recorder_feed import RecorderFeed, RunReports
from gridpeers.wire.codec import RejectedError
from gridpeers.wire.links import REPORT_TICKS
from gridpeers.wire.messages import PLANT, Prepare, Ready, State
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Post, Route
from gridpeers.wire.tick_policy import WAIT, TickVerdict
from gridpeers.wire.timing import Awaited, TickBarrier

_TICKS = frozenset({"preparing", "running", "joining", "holding"})
"""Phases in which the plant goes on once all awaited messages are there."""


class LockstepBarrier:
    """A tick policy (`gridpeers.wire.tick_policy`): it measures as soon as it has advanced."""

    grants, waiting, recording = True, AGAIN, inf
    report_ticks = TELEMETRY_TICKS, REPORT_TICKS

    def __init__(self, post: Post, stepper: PlantStepper, phases: Phases, feed: RecorderFeed) -> None:
        if stepper.config.end is None:
            raise ValueError("end: a run in simulated time must have one; give a multiple of T_c in s")
        self._stepper, self._phases, self._feed = stepper, phases, feed
        self.waits = TickBarrier(PLANT, stepper.config.deadline)
        self.waits.last_heard = post.last_heard
        self.again_at = inf

    @property
    def messages_needed(self) -> int:
        return self.waits.messages_needed

    @property
    def deadline(self) -> float | None:
        deadline = min(self.waits.deadline or inf, self.again_at)
        return None if deadline == inf else deadline

    def start(self, now: float) -> None:
        self.waits.renew(now)
        self.again_at = now + AGAIN

    def run_time(self, t: float, now: float) -> float:
        return t

    def due(self, now: float) -> int | None:
        """Return the tick to do now; before it, perhaps the roster has to change."""
        return self._stepper.tick if self._phases.now in _TICKS and not self.waits.awaited else None

    def counts(self, state: State, now: float) -> bool:
        """Take a state off the wire; return whether it is awaited in this tick."""
        if state.seq != self._stepper.tick or self._phases.now != "running":
            return False
        return self.waits.awaited.pop(state.sender, None) is not None

    def missing(self) -> tuple[Awaited, ...]:
        return self.waits.missing_messages()

    def passed(self, now: float, unmet: tuple[Awaited, ...] = ()) -> TickVerdict:
        if not self.waits.is_over(now):
            return WAIT
        if unmet and self._feed.is_silent(now):  # the process that records also starts the agents
            self.waits.renew(now)
            return WAIT
        missing = unmet or self.missing()
        if not missing:  # the last awaited message has just arrived, or the run ends
            return TickVerdict("over")
        return TickVerdict("break", self.waits.complaint(missing, now))

    def heard(self, now: float) -> None: ...

    def measured(self, names: Iterable[str], now: float) -> None:
        """Begin the wait for the states of a tick."""
        self.wait_for(f"State({self._stepper.tick})", names, inf, now)

    def wait_for(self, message: str, names: Iterable[str], again_at: float, now: float) -> None:
        """Begin to wait for a message of each of these agents."""
        self.waits.wait_for(dict.fromkeys(names, message), now)
        self.again_at = again_at

    def wait_until(self, until: float, again_at: float = inf) -> None:
        self.waits.wait_for({}, until)
        self.waits.deadline, self.again_at = None if until == inf else until, again_at


class LockstepRoster:
    def __init__(self, meeting: Meeting, barrier: LockstepBarrier, reports: RunReports) -> None:
        self._meeting, self._barrier, self._reports = meeting, barrier, reports
        post, stepper, config = meeting.post, meeting.stepper, meeting.stepper.config
        self._post, self._stepper, self._phases = post, stepper, meeting.phases
        self._schedule = agent_schedule(config, stepper.inverters)
        joiners = {it.inverter for it in config.schedule if it.action == "join"}.difference(config.agents)
        self.everyone = (*config.agents, *(name for name in stepper.inverters if name in joiners))
        self.names: tuple[str, ...] = ()  # agents of the last roster sent
        self.state_keys, self.publications = (post.keys.state,), ()
        self._number = -1  # of that roster
        self._changed = False  # whether an agent has joined or gone since
        self._joining: tuple[str, ...] = ()  # newcomers that the held tick waits for; they may appear then
        self._prepare: Prepare | None = None  # that roster
        for name in self.everyone:
            post.routes[post.keys.ready(name)] = Route(name, (Ready,), self._on_ready)

    def refusal(self, name: str, instance: str) -> str:
        counts = self._post.members.instance(name)
        if name not in self.everyone:
            return f"{name}: the plant waits for no agent of this name, only for {', '.join(self.everyone)}"
        if counts not in ("", instance):
            return f"{name}: another agent of this name takes part in the run already; give this one another name"
        if self._phases.now == "gathering" and name not in self._stepper.config.agents:
            return f"{name}: the scenario lets it join later; start it when the plant awaits it"
        if self._phases.now != "gathering" and not counts and name not in self._joining:
            return f"{name}: the run has begun, at t = {self._stepper.t:g} s; an agent can join only before its start"
        return ""

    def missing(self) -> tuple[Awaited, ...]:
        """Return the tokens and nameplates that are missing."""
        match self._phases.now:
            case "gathering":
                return self._meeting.missing(self._stepper.config.agents, recorders=True)
            case "joining":
                return self._meeting.missing(self._joining)
        return ()

    def met(self, name: str, now: float) -> None:
        """Take the nameplate of a process that counts as progress."""
        if self._phases.now == "gathering":
            self._barrier.waits.renew(now)

    def died(self, name: str, now: float) -> None:
        """Note that the process of an agent is gone."""
        stepper, phase = self._stepper, self._phases.now
        stepper.reproducible = False
        self._changed = True
        self._barrier.waits.awaited.pop(name, None)  # its message will never come
        if phase == "gathering" or (phase == "preparing" and self._number == 0):
            stepper.broken = f"{name} died before the run began"
        elif name in self._joining:
            stepper.broken = f"{name} died at t = {stepper.t:g} s, before it had joined"
        else:
            stepper.note("roster", name, f"{name} died at t = {stepper.t:g} s; {STAYS}")
            if phase == "preparing":  # no agent can get ready to hear a dead one
                self.begin(now)

    def settle(self, now: float) -> bool:
        """Let agents leave, die and join, as scheduled for this tick; return whether the plant may measure now."""
        self._move(self._schedule.pop(self._stepper.tick, []), now)
        if self._phases.now == "joining":
            if self.missing():
                return False
            joined, self._joining, self._changed = self._joining, (), True
            for name in joined:  # their inverters are on the network, at no load
                self._connect(name, True)
        if self._changed and not self._stepper.broken:
            self.begin(now)
            return False
        return True

    def advanced(self, now: float) -> None:
        """Do nothing: an agent that is silent holds the tick."""

    def ask_again(self) -> None:
        """Ask for the nameplates that are missing, or send the same roster again to those that are not ready."""
        if self._prepare is not None and self._phases.now == "preparing":
            self._reports.publish_aside(self._post.keys.control, self._prepare)
        elif self._phases.now != "holding":
            self._post.ask_again()

    def begin(self, now: float) -> None:
        """Send the roster of all agents that are here, and have them get ready for each other."""
        members = self._post.members
        self.names = tuple(name for name in self.everyone if members.instance(name))
        self._number += 1
        self._changed = False
        self._phases.on("prepare")
        self._barrier.wait_for(f"Ready({self._number})", self.names, now + AGAIN, now)
        instances = tuple(members.instance(name) for name in self.names)
        epoch, t = self._post.epoch, self._stepper.t
        self._prepare = Prepare(
            sender=PLANT, epoch=epoch, seq=self._number, t=t, roster=self.names, instances=instances
        )
        self._post.send(self._post.keys.control, self._prepare)

    def _move(self, actions: list[ScheduledAction], now: float) -> None:
        when = f"at t = {self._stepper.t:g} s, as the scenario says"
        for name in [it.inverter for it in actions if it.action == "leave"]:
            self._dismiss(name, f"{name} leaves {when}")
            self._connect(name, False)
        for name in [it.inverter for it in actions if it.action == "die"]:
            self._dismiss(name, f"{name} dies {when}; {STAYS}")
        coming = [it.inverter for it in actions if it.action == "join"]
        joining = tuple(name for name in coming if not self._post.members.instance(name))
        for name in joining:
            self._stepper.note("roster", name, f"{name} joins {when}")
        if joining and not self._stepper.broken:
            self._joining = joining
            self._phases.on("join")
            self._barrier.wait_for("", (), now + AGAIN, now)
            self._reports.telemetry(awaited=joining)

    def _dismiss(self, name: str, text: str) -> None:
        """Send an agent's process, if there is one, a stop request; it takes part no more."""
        self._stepper.note("roster", name, text)
        self._changed = True
        instance = self._post.members.instance(name)
        if instance:
            self._post.members.dismiss(name)
            self._meeting.stop(self._post.keys.stop_request(name, instance), text)

    def _connect(self, name: str, on: bool) -> None:
        if not self._stepper.broken and self._stepper.connect(name, on):
            self._stepper.collect()

    def _on_ready(self, ready: Ready, payload: bytes, now: float) -> None:
        if ready.seq != self._number:
            raise RejectedError("stale", f"Ready({ready.seq}) of {ready.sender} in phase {self._phases.now}")
        if self._phases.now == "preparing":  # else it is the answer to a Prepare that was sent again
            self._barrier.waits.awaited.pop(ready.sender, None)
            self._barrier.waits.renew(now)
