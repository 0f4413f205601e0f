"""One agent as a participant of a run, under either kind of time. Pure.

The node meets the other agents, hears its in-neighbours by the run's graph, passes their states through the emulated
links, if there are any, and sends what the agent decides. Its tick policy says when it ticks, with what, and what
follows if something is late: `gridpeers.agents.tick_barrier` in simulated time, `gridpeers.agents.tick_timer` in real
time. Its phases: *seeking* a plant; *waiting* for a measurement; *meeting* the agents of a roster, in simulated time;
*running*, that is ticking, from the set-points that the plant holds; *leaving*, while its last accounts are on their
way or the plant takes its inverter off the network; *over*.
"""

from __future__ import annotations

from typing import Protocol

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig, check_nameplate
from gridpeers.agents.agent_reports import AgentReports
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.agents.hearing import Hearing, OpenMeeting
from gridpeers.agents.laws.law import Law
from gridpeers.agents.roster_meeting import KnownAgents, RosterMeeting
from gridpeers.agents.tick_barrier import AgentBarrier
from gridpeers.agents.tick_timer import AgentTimer
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.journal import JournalBuffer, Traffic
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, Measurement, Prepare, State, Stop, Waiting
from gridpeers.wire.phases import Phases, PhaseTable
from gridpeers.wire.post import FollowedPlant, Post, Route
from gridpeers.wire.tick_policy import TickPolicy, TickVerdict

_ENDS = {"leave": "leaving", "end": "over"}

AGENT_PHASES: PhaseTable = {
    "seeking": {"plant appeared": "waiting", **_ENDS},
    "waiting": {"measured": "running", "roster": "meeting", "plant gone": "seeking", "new session": "seeking", **_ENDS},
    "meeting": {"roster": "meeting", "ready": "waiting", **_ENDS},
    "running": {"held": "waiting", "roster": "meeting", "new session": "seeking", **_ENDS},
    "leaving": {"end": "over"},
    "over": {},
}


class AgentTickPolicy(TickPolicy, Protocol):
    """Tick policy of an agent, with the further questions of its node; each kind of time has its own answers."""

    at: float
    """Time of the last measurement or tick (s of run time)."""
    plant_seen: bool

    @property
    def t(self) -> float:
        """Run time (s) that the agent has come to."""

    @property
    def awaits_states(self) -> bool:
        """True if the next state may make the tick due."""

    @property
    def meeting(self) -> RosterMeeting | OpenMeeting: ...
    @property
    def control_messages(self) -> tuple[type[Prepare | Waiting | Stop], ...]: ...

    @property
    def publications(self) -> tuple[str, ...]:
        """Keys beside those of states, journal and report."""

    @property
    def quiet_key(self) -> str:
        """Key of a state that the law does not send to the neighbours."""

    def plant_came(self, now: float) -> None: ...
    def plant_waits(self, message: Waiting | Prepare, now: float) -> None: ...
    def new_plant(self) -> None: ...
    def new_session(self) -> None: ...

    def gone(self, name: str) -> TickVerdict:
        """Note that a process is gone; of the plant, say what follows."""

    def granted(self, message: Measurement, now: float) -> bool:
        """Take a measurement off the wire; return whether its tick is due. RejectedError if it is unexpected."""

    def hold(self, why: str) -> None:
        """Note that the agent has no measurement to go by."""

    def joined(self, measurement: Measurement) -> None:
        """Note that the agent ticks from this measurement on."""

    def decide(
        self, agent: Agent, measurement: Measurement | None, decisions: DecisionJournal | None, now: float
    ) -> State | None:
        """Compute the tick that is due; None if nothing is to be sent."""

    def ticked(self, now: float) -> bool:
        """Do what is due after a tick; return whether a new session is needed."""

    def leave(self, now: float) -> bool:
        """Begin to leave; return whether there is anything to wait for."""


class AgentNode:
    """A node (`gridpeers.wire.node`), on one session after the other if need be.

    `instance` is the id of this process, unique in the run, and part of the agent's token. Without `links` none are
    emulated; without a law it is the paper's. `known` is what the agents of this process know of the others in
    simulated time; by default this agent shares it with nobody.
    """

    def __init__(
        self,
        config: AgentConfig,
        instance: str,
        links: Links | None = None,
        law: Law | None = None,
        known: KnownAgents | None = None,
    ) -> None:
        check_nameplate(config)
        name, realtime = config.name, config.clock == "realtime"
        known = KnownAgents(config.control) if known is None else known
        post = self.post = Post(name, config.run, config.epoch, None if realtime else known.members)
        keys = self.keys = post.keys
        self.admission, self.rejects, self.routes = post.admission, post.rejects, post.routes
        self.received, self.lost = post.received, post.lost
        self.take_actions, self.take_rejects = post.take_actions, post.take_rejects
        self.name, self.watched, self.token = name, keys.any_alive, keys.alive_agent(name, instance)
        self.tokens = (self.token,)
        self.siblings: set[str] = set()

        phases = self.phases = Phases(AGENT_PHASES)
        self.stopped = ""
        self.failed = ""
        """Why the agent could not continue, or take part at all; empty otherwise."""
        self.session_broken = False
        self._config, self._instance = config, instance
        self._plant, self._plant_epoch = FollowedPlant(post, self._follow), 0
        agent = Agent(config if realtime else config.by_own_clock(), law)
        agent.rejects = self.rejects
        self.nameplate = keys.nameplate(name, instance), encode(agent.nameplate)
        """Key of the own queryable, and its answer."""
        heard = self.heard = Hearing(agent, links)
        reports = self._reports = AgentReports(post, heard, instance, empty=links is not None and not realtime)
        self._reason = ""  # why it leaves
        self._timed: Traffic | None = None
        self._decisions: DecisionJournal | None = None
        if config.record != "physics":
            post.journal = JournalBuffer()
            self._decisions = DecisionJournal(agent, post.journal)
            if realtime:
                self._timed = post.traffic = Traffic(keys, post.journal, arrivals=config.record == "all")

        self.policy: AgentTickPolicy
        if realtime:
            open_meeting = OpenMeeting(post, heard, self._on_state)
            self.policy = AgentTimer(config, post, phases, heard, open_meeting, reports, self._timed)
        else:
            known.add(agent.nameplate)
            roster = RosterMeeting(post, phases, known, agent, instance, self._on_state)
            self.policy = AgentBarrier(config, post, phases, heard, roster, reports, self.siblings)
        post.on_nameplate = self.policy.meeting.on_nameplate
        self.routes[keys.stop_request(name, instance)] = Route(PLANT, (Stop,), self._on_stop)
        self.routes[keys.measurement(name)] = Route(PLANT, (Measurement,), self._on_measurement)
        self.routes[keys.control] = Route(PLANT, self.policy.control_messages, self._on_control)
        self._first_routes = dict(self.routes)
        self._state_key = keys.state(name)
        self.publications = self._state_key, keys.report(name), keys.journal(name), *self.policy.publications

    # ---------------------------------------------------------------- what the driver needs

    @property
    def subscriptions(self) -> tuple[str, ...]:
        return tuple(self.routes)

    @property
    def finished(self) -> bool:
        return self.session_broken or self.phases.now == "over"

    @property
    def messages_needed(self) -> int:
        return self.policy.messages_needed

    @property
    def deadline(self) -> float | None:
        return self.policy.deadline

    def start(self, now: float) -> None:
        """Begin, or begin again after a broken session; there is nothing to do yet."""
        self.policy.start(now)
        if self._timed is not None:
            self._timed.process("session" if self.session_broken else "start", f"instance {self._instance}", now)
        if not self.session_broken:
            return
        self.session_broken = self.post.closed = False
        if self.phases.now == "leaving":  # what it said last may be lost with the old session
            self._end(stopped=self._reason)
            return
        if self.phases.allows("new session"):
            self.phases.on("new session")
        self.heard.agent.restart()
        self.routes.clear()
        self.routes.update(self._first_routes)
        self._plant.present.clear()
        self.admission.release(PLANT)
        self.policy.new_session()

    def work(self, now: float) -> bool:
        return False

    def appeared(self, key: str, now: float) -> None:
        match self.post.token(key, now, appeared=True):
            case ("alive", "plant", epoch) if self._plant.appeared(epoch):
                self.policy.plant_came(now)
                if self.phases.now == "seeking":
                    self.phases.on("plant appeared")
            case ("alive", "agent", name, instance) if name != self.name:
                self.post.process_came(name, instance)

    def vanished(self, key: str, now: float) -> None:
        match self.post.token(key, now, appeared=False):
            case ("alive", "plant", epoch) if self._plant.vanished(epoch):
                verdict = self.policy.gone(PLANT)
                if self.phases.now == "leaving":
                    self._end(stopped=self._reason)
                elif verdict.kind == "break":
                    self._end(failed=verdict.reason)
                else:
                    self.policy.hold(verdict.reason)
                    if not self._plant.present and self.phases.allows("plant gone"):
                        self.phases.on("plant gone")
            case ("alive", "agent", name, instance) if self.policy.meeting.gone(name, instance):
                self.policy.gone(name)
                if self.policy.due(now) is not None and not self.finished:
                    self._tick(now)

    def expire(self, now: float) -> None:
        deadline = self.policy.deadline
        if self.finished or deadline is None or now < deadline:
            return
        if self._timed is not None:
            self._timed.woken(now)
        verdict = self.policy.passed(now)
        if verdict.kind == "over":
            self._reports.last(self.policy.t)
            self._end(stopped=self._reason)
        elif verdict.kind == "break":
            self._end(failed=verdict.reason)
        elif verdict.kind == "tick":
            self._tick(now)

    # ---------------------------------------------------------------- messages

    def _follow(self, epoch: int) -> None:
        """Begin anew with another plant; one whose token was gone for a while goes on where it was."""
        if self._plant_epoch not in (0, epoch):
            self.policy.new_plant()
        self._plant_epoch = epoch

    def _on_control(self, message: Prepare | Waiting | Stop, payload: bytes, now: float) -> None:
        if isinstance(message, Stop):
            self._on_stop(message, payload, now)
        else:
            self.policy.plant_waits(message, now)

    def _on_stop(self, message: Stop, payload: bytes, now: float) -> None:
        if message.refused:
            self._end(failed=message.reason)
        elif self.phases.now == "leaving":
            self._end(stopped=self._reason)
        else:
            self._leave(message.reason, now)

    def _on_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        if message.to != self.name:
            raise RejectedError("unexpected", f"the measurement of {message.to}")
        is_due = self.policy.granted(message, now)
        at = self.policy.at
        if self.admission.is_usable(self.heard.links, message, payload, at):
            self.heard.keep(message, at)
        if is_due:
            self._tick(now)

    def _on_state(self, state: State, payload: bytes, now: float) -> None:
        if self.policy.counts(state, now):
            at = self.policy.run_time(state.t, now)
            if self.admission.is_usable(self.heard.links, state, payload, at):
                self.heard.keep(state, at)
        if self.policy.awaits_states and self.policy.due(now) is not None:
            self._tick(now)

    # ---------------------------------------------------------------- ticks

    def _tick(self, now: float) -> None:
        """Decide the tick that is due and send it; without a measurement the agent is on hold. Leaving, report."""
        policy, heard = self.policy, self.heard
        if self.phases.now == "leaving":
            self._reports.last(policy.t)
            return
        at = policy.at
        for message in () if heard.links is None else self.admission.arrived(heard.links, at, self.rejects):
            heard.keep(message, at)
        if PLANT in self.admission.epochs:  # else the last measurement of a plant that is gone would still look fresh
            measured = heard.measurement if round(at - heard.measured_at, 9) <= self._config.max_age else None
            if measured is None:
                policy.hold("no recent measurement; holds its set-points")
            elif self.phases.now == "waiting":
                self.phases.on("measured")
                policy.joined(measured)
            state = policy.decide(heard.agent, measured, self._decisions, now)
            if state is not None:
                self.post.publish(policy.quiet_key if state.quiet else self._state_key, encode(state))
        if policy.ticked(now):
            self.session_broken = self.post.closed = True

    # ---------------------------------------------------------------- the end

    def leave(self, reason: str) -> None:
        """Leave in real time, as somebody outside of the run asks for it; noted, because a replay must do the same."""
        if self._timed is not None and not self.finished and self.phases.now != "leaving":
            self._timed.process("leave", reason)
        self._leave(reason, 0.0)

    def _leave(self, reason: str, now: float) -> None:
        """Send the last accounts, and close once the plant has them; at once if there is nothing to wait for.

        In simulated time the account of emulated links needs the neighbours' last states. In real time the plant takes
        the inverter off the network.
        """
        if self.finished or self.phases.now == "leaving":
            return
        self._reason = reason
        self.phases.on("leave")
        if not self.policy.leave(now):
            self._end(stopped=reason)
        elif self.policy.due(now) is not None:
            self._tick(now)

    def _end(self, *, stopped: str = "", failed: str = "") -> None:
        if not self.finished:
            self.stopped, self.failed = stopped, failed
            self.phases.on("end")
            self.post.closed = True
