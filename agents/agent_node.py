"""One agent as a participant of a run, under either kind of time. Pure.

The node meets the other agents, hears its in-neighbours by the run's graph, passes their states through the emulated
links, if there are any, and sends what the agent decides. Its tick policy says when it ticks, with what, and what
follows if something is late: `gridpeers.agents.tick_barrier` in simulated time, `gridpeers.agents.tick_timer` in real
time. Its phases: *seeking* a plant; *waiting* for a measurement; *meeting* the agents of a roster, in simulated time;
*running*, that is ticking, from the set-points that the plant holds; *leaving*, while its last accounts are on their
way or the plant takes its inverter off the network; *over*.
"""

from __future__ import annotations

from collections.abc import Callable

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig, check_nameplate
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.agents.hearing import Hearing, OpenMeeting
from gridpeers.agents.laws.law import Law
from gridpeers.agents.roster_meeting import KnownAgents, RosterMeeting
from gridpeers.agents.tick_barrier import AgentBarrier
from gridpeers.agents.tick_timer import AgentTimer
from gridpeers.agents.upkeep import JOURNAL_PERIOD, Upkeep
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.journal import JournalBuffer, TimedTraffic
from gridpeers.wire.links import Links
from gridpeers.wire.messages import PLANT, LinkRequest, Measurement, Prepare, State, Stop, Waiting
from gridpeers.wire.phases import Phases, PhaseTable
from gridpeers.wire.post import FollowedPlant, Post, Route

_ENDS = {"leave": "leaving", "end": "over"}

AGENT_PHASES: PhaseTable = {
    "seeking": {"plant appeared": "waiting", **_ENDS},
    "waiting": {"measured": "running", "roster": "meeting", "plant gone": "seeking", "new session": "seeking", **_ENDS},
    "meeting": {"roster": "meeting", "ready": "waiting", **_ENDS},
    "running": {"held": "waiting", "roster": "meeting", "new session": "seeking", **_ENDS},
    "leaving": {"end": "over"},
    "over": {},
}


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
        name, realtime = config.name, config.clock == "wall"
        known = KnownAgents(config.control) if known is None else known
        own: tuple[Callable[[str], str], ...]
        post = self.post = Post(name, config.run, config.epoch, None if realtime else known.members)
        keys = self.keys = post.keys
        self.admission, self.rejects, self.routes = post.admission, post.rejects, post.routes
        self.received, self.lost = post.received, post.lost
        self.take_actions, self.take_rejects = post.take_actions, post.take_rejects
        self.name, self.watched, self.token = name, keys.any_alive, keys.alive_agent(name, instance)
        self.tokens = (self.token,)
        self.siblings: set[str] = set()
        """Agents of the same process, whose messages do not come from outside."""

        self.phases = Phases(AGENT_PHASES)
        self.stopped = ""
        self.failed = ""
        """Why the agent could not continue, or take part at all; empty otherwise."""
        self.session_broken = False
        self._config, self._instance = config, instance
        self._plant, self._plant_epoch = FollowedPlant(post, self._follow), 0
        self._agent = Agent(config if realtime else config.by_own_clock(), law)
        self._agent.rejects = self.rejects
        self.nameplate = keys.nameplate(name, instance), encode(self._agent.nameplate)
        """Key of the own queryable, and its answer."""
        self.heard = Hearing(self._agent, links)
        self._reason = ""
        """Why it leaves."""
        self._ran = self._reported = False
        self._journal_at = 0.0
        self._timed: TimedTraffic | None = None
        self._decisions: DecisionJournal | None = None
        if config.record != "physics":
            post.journal = JournalBuffer()
            self._decisions = DecisionJournal(self._agent, post.journal)
            if realtime:
                self._timed = post.traffic = TimedTraffic(keys, post.journal, arrivals=config.record == "all")

        self.routes[keys.stop_request(name, instance)] = Route(PLANT, (Stop,), self._on_stop)
        self.routes[keys.measurement(name)] = Route(PLANT, (Measurement,), self._on_measurement)
        self.policy: AgentBarrier | AgentTimer
        self._meeting: RosterMeeting | OpenMeeting
        self._prepare: Callable[[Prepare, float], None] | None = None
        self.upkeep: Upkeep | None = None
        """What is to be done in real time beside the ticks."""
        if realtime:
            self._meeting = meeting = OpenMeeting(post, self._agent, self._on_state)
            self.policy = timer = AgentTimer(config, post, self.phases, self.heard, meeting, self._timed)
            self.upkeep = Upkeep(timer, links)
            self.routes[keys.control] = Route(PLANT, (Waiting, Stop), self._on_control)
            self.routes[keys.link_request(name)] = Route(PLANT, (LinkRequest,), self.upkeep.on_link_command)
            own = keys.set_points, keys.leave, keys.status, keys.link_acknowledgement
        else:
            known.add(self._agent.nameplate)
            roster = self._meeting = RosterMeeting(post, self.phases, known, self._agent, instance)
            roster.on_state, self._prepare = self._on_state, roster.on_prepare
            self.policy = AgentBarrier(config, post, self.heard, roster, self.siblings)
            self.routes[keys.control] = Route(PLANT, (Prepare, Waiting, Stop), self._on_control)
            own = (keys.ready,)
        post.on_nameplate = self._meeting.on_nameplate
        self.publications = tuple(key(name) for key in (keys.state, keys.report, keys.journal, *own))
        self._first_routes = dict(self.routes)
        self._state_key = keys.state(name)
        self._quiet_key = keys.set_points(name) if realtime else self._state_key

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
        if self.upkeep is None:
            return
        self.upkeep.start(now)
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
        self._agent.restart()
        self.routes.clear()
        self.routes.update(self._first_routes)
        self._plant.present.clear()
        self.admission.release(PLANT)
        self.upkeep.new_session()

    def work(self, now: float) -> bool:
        return False

    def appeared(self, key: str, now: float) -> None:
        match self.post.token(key, now, appeared=True):
            case ("alive", "plant", epoch) if self._plant.appeared(epoch):
                self.policy.plant_came(now)
                if self.phases.now == "seeking":
                    self.phases.on("plant appeared")
                    if self.upkeep is not None:
                        self.post.say("the plant is there; waits for its measurement")
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
                    self._hold(verdict.reason)
                    if not self._plant.present and self.phases.allows("plant gone"):
                        self.phases.on("plant gone")
            case ("alive", "agent", name, instance) if self._meeting.gone(name, instance):
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
            self._report_the_last()
            self._end(stopped=self._reason)
        elif verdict.kind == "break":
            self._end(failed=verdict.reason)
        elif verdict.kind == "tick" and self.upkeep is not None:
            if verdict.reason:
                self._hold(verdict.reason)
            shown = self.upkeep.shown
            self._tick(now)
            self.session_broken = self.post.closed = self.upkeep.ticked(shown, bool(self._agent.fault), now)

    # ---------------------------------------------------------------- messages

    def _follow(self, epoch: int) -> None:
        """Begin anew with another plant; one whose token was gone for a while goes on where it was."""
        if self._plant_epoch not in (0, epoch) and self.upkeep is not None:
            self._hold("the plant restarted; starts from its measurement")
            self._ran = False
            self.upkeep.new_plant()
        self._plant_epoch = epoch

    def _on_control(self, message: Prepare | Waiting | Stop, payload: bytes, now: float) -> None:
        if isinstance(message, Stop):
            self._on_stop(message, payload, now)
        else:
            if isinstance(message, Prepare) and self._prepare is not None:
                self._prepare(message, now)
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
        at = message.t if self.upkeep is None else now * self._config.speed
        if self.admission.is_usable(self.heard.links, message, payload, at):
            self.heard.keep(message, at)
        if is_due:
            self._tick(now)

    def _on_state(self, state: State, payload: bytes, now: float) -> None:
        at = state.t if self.upkeep is None else now * self._config.speed
        if self.policy.counts(state, now) and self.admission.is_usable(self.heard.links, state, payload, at):
            self.heard.keep(state, at)
        if self.policy.awaits_states and self.policy.due(now) is not None:
            self._tick(now)

    # ---------------------------------------------------------------- ticks

    def _tick(self, now: float) -> None:
        """Decide the tick that is due and send it; without a measurement the agent is on hold. Leaving, report."""
        if self.phases.now == "leaving":
            self._report_the_last()
            return
        post, policy, heard = self.post, self.policy, self.heard
        at = policy.at
        for message in () if heard.links is None else self.admission.arrived(heard.links, at, self.rejects):
            heard.keep(message, at)
        if PLANT not in self.admission.epochs:
            return  # the last measurement of a plant that is gone would still look fresh
        measured = heard.measurement if round(at - heard.measured_at, 9) <= self._config.max_age else None
        if measured is not None:
            if self.phases.now == "waiting":
                self.phases.on("measured")
                if self.upkeep is not None:
                    joins, P_set, V_set = "goes on" if self._ran else "joins", measured.P_set, measured.V_set
                    post.say(f"{joins} at t = {measured.t:.2f} s, from {P_set:.0f} W and {V_set:.1f} V")
                self._ran = True
        elif self.upkeep is not None:
            self._hold("no recent measurement; holds")
        elif self.phases.now == "running":
            self.phases.on("held")
        state = policy.decide(self._agent, measured, self._decisions, now)
        if state is None:
            return
        journal, linked = post.journal, heard.links is not None
        # Without links entries are rare, and none may wait: once the plant has the last state, the run is over.
        due = (policy.reports or now - self._journal_at >= JOURNAL_PERIOD) if linked else journal
        if due and journal is not None and self.upkeep is None:
            self._journal_at = now
            post.send(self.keys.journal(self.name), *post.take_journal(at, empty=linked))
        post.publish(self._quiet_key if state.quiet else self._state_key, encode(state))
        if policy.reports:
            post.send(self.keys.report(self.name), *post.take_link_reports(heard.links, instance=self._instance))
        if isinstance(policy, AgentBarrier):
            for early, payload in policy.take_early():
                if self.admission.is_usable(heard.links, early, payload, early.t):
                    heard.keep(early, early.t)

    def _hold(self, why: str) -> None:
        """Drop in real time what was heard; the next measurement shows the set-points to start from."""
        if self.phases.now == "running":
            self.phases.on("held")
            self.post.say(why)
        if self.upkeep is not None:
            self.upkeep.hold()
        self._agent.restart()

    # ---------------------------------------------------------------- the end

    def leave(self, reason: str) -> None:
        """Leave in real time, as somebody outside of the run asks for it; noted, because a replay must do the same."""
        if self._timed is not None and not self.finished and self.phases.now != "leaving":
            self._timed.process("leave", reason, self._timed.now)
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
        waits = self.heard.links is not None
        if self.upkeep is not None:
            self._report_the_last()
            self.upkeep.leave()
            waits = bool(self._plant.present)
        if not waits:
            self._end(stopped=reason)
            return
        self.policy.leave(now)
        if self.policy.due(now) is not None:
            self._tick(now)

    def _report_the_last(self) -> None:
        post, links = self.post, self.heard.links
        if not self._reported:
            self._reported = True
            empty = links is not None and self.upkeep is None
            post.send(self.keys.journal(self.name), *post.take_journal(self.policy.t, empty=empty))
            post.send(self.keys.report(self.name), *post.take_link_reports(links, instance=self._instance, last=True))

    def _end(self, *, stopped: str = "", failed: str = "") -> None:
        if not self.finished:
            self.stopped, self.failed = stopped, failed
            self.phases.on("end")
            self.post.closed = True

    def change(self, config: AgentConfig, law: Law | None = None) -> None:
        """Go on under another rule of control, in a replay that asks what would have been; see `Agent.taken_over`."""
        self._config, self._agent = config, self._agent.taken_over(config, law)
        self._agent.rejects = self.rejects
        if self._decisions is not None:
            self._decisions = DecisionJournal(self._agent, self._decisions.journal)
        if self.upkeep is not None:
            self.upkeep.change(config, self._agent)
