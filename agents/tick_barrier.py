"""When an agent ticks in simulated time. Pure; the driver's clock serves deadlines only.

Tick k is due once Measurement(k), its grant, and State(k-1) of every in-neighbour on the roster are here.

**When a tick is late** the agent waits, for as long as the plant shows that it is there: each `Waiting`, roster and
measurement begins the wait anew. A neighbour that dies is waited for no more. After `DEADLINES` times the configured
deadline without any of it the agent breaks off and names the missing messages. The plant, which waits half as long and
sees all agents, names the culprit first. A process that was stopped itself (Ctrl-Z) waits once more.

docs/reference/protocol.md shows that this cannot deadlock.
"""

from __future__ import annotations

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_reports import JOURNAL_PERIOD, AgentReports
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.agents.hearing import Hearing
from gridpeers.agents.roster_meeting import RosterMeeting
from gridpeers.wire.codec import RejectedError, payload_of
from gridpeers.wire.links import REPORT_TICKS
from gridpeers.wire.messages import PLANT, Measurement, Prepare, Ready, State, Stop, Waiting
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Post
from gridpeers.wire.tick_policy import WAIT, TickVerdict
from gridpeers.wire.timing import Awaited, TickBarrier, time_of

CLOSING = 2.0  # Longest wait (s) for the last states of neighbours, and for the acknowledgement of the report on links
DEADLINES = 2.0  # An agent waits this many deadlines, so that the plant reports the error first


class AgentBarrier:
    """A tick policy (`gridpeers.wire.tick_policy`): a barrier before each tick."""

    grants = True
    control_messages = Prepare, Waiting, Stop

    def __init__(
        self,
        config: AgentConfig,
        post: Post,
        phases: Phases,
        heard: Hearing,
        meeting: RosterMeeting,
        reports: AgentReports,
        siblings: set[str],
    ) -> None:
        self._T_c, self._plant_wait = config.T_c, config.plant_wait
        self._post, self._phases, self._heard, self.meeting, self._reports = post, phases, heard, meeting, reports
        meeting.on_ready = self._on_ready
        self.publications = (post.keys.ready(post.name),)
        self.quiet_key = post.keys.state(post.name)
        self._waits = TickBarrier(config.name, DEADLINES * config.deadline)
        self._waits.last_heard, self._waits.siblings = post.last_heard, siblings
        self.at = 0.0
        """Time t_k of the tick that is due (s of run time)."""
        self.awaits_states = False
        """Whether the next state may make the tick due: its measurement is here, or the agent leaves."""
        self._journal_at = 0.0
        self._accounts_due = False
        self.plant_seen = self._leaving = False
        self._tick: int | None = None
        """The next tick; None before the first measurement."""
        self._grant: Measurement | None = None
        self._early: dict[str, tuple[State, bytes]] = {}
        """States of this tick that arrived before it was done, and their bytes."""
        self._present: tuple[int, tuple[str, ...]] = -1, ()
        """Changes of the members by then, and the in-neighbours whose processes on the roster are here."""
        self._neighbours: tuple[str, ...] = ()
        self._neighbours_of: dict[str, str] = {}
        """In-neighbours whose states the next tick needs, and the roster of that time."""

    @property
    def messages_needed(self) -> int:
        return self._waits.messages_needed

    @property
    def deadline(self) -> float | None:
        return self._waits.deadline

    @property
    def t(self) -> float:
        """Run time (s) of the next tick."""
        return time_of(self._tick or 0, self._T_c)

    def start(self, now: float) -> None:
        self._waits.renew(now)
        self._waits.deadline = max(self._waits.deadline or 0.0, now + self._plant_wait)

    def plant_came(self, now: float) -> None:
        # The plant may compile, or wait for agents yet to start. If it dies, its token vanishes and ends this wait.
        self.plant_seen = True
        self._waits.rest()

    def plant_waits(self, message: Waiting | Prepare, now: float) -> None:
        if isinstance(message, Prepare):
            self.meeting.on_prepare(message, now)
        self._waits.renew(now)

    def new_plant(self) -> None:
        """Do nothing: in simulated time a run ends with its plant."""

    def new_session(self) -> None:
        """Do nothing: in simulated time a run ends with a session."""

    def gone(self, name: str) -> TickVerdict:
        """Note that a process is gone; the agent no longer waits for it."""
        if name == PLANT:
            tick = "" if self._tick is None else f" at tick {self._tick}"
            return TickVerdict("break", f"{self._post.name}: the plant is gone{tick}; the run has ended")
        self._waits.awaited.pop(name, None)
        return WAIT

    def hold(self, why: str) -> None:
        if self._phases.now == "running":
            self._phases.on("held")

    def joined(self, measurement: Measurement) -> None:
        """Do nothing: the plant says who is on the roster."""

    def leave(self, now: float) -> bool:
        """Return whether the agent must wait: an account of links needs the last states of the neighbours."""
        if self._heard.links is None:
            return False
        self._leaving = self.awaits_states = True
        self._waits.deadline = now + CLOSING
        return True

    def run_time(self, t: float, now: float) -> float:
        return t

    def due(self, now: float) -> int | None:
        """Return the tick to do now; the next one also if the agent leaves and has the neighbours' last states."""
        if self._leaving:
            return self._tick or 0 if self._waits.awaited.keys().isdisjoint(self._neighbours) else None
        return None if self._grant is None or self._waits.awaited else self._tick

    def granted(self, message: Measurement, now: float) -> bool:
        """Take a measurement as the grant of its tick, return whether it is due; RejectedError if not the next."""
        if not self.meeting.ready:
            raise RejectedError("unexpected", "no roster has this process on it")
        if self._tick is None:
            if abs(message.t - time_of(message.seq, self._T_c)) > self._T_c / 2:
                raise RejectedError("implausible", f"tick {message.seq} at t = {message.t:g} s")
            self._tick = message.seq
            self._early = {name: early for name, early in self._early.items() if early[0].seq == message.seq}
        if message.seq != self._tick or self._grant is not None:
            kind = "unexpected" if message.seq > self._tick else "stale"
            raise RejectedError(kind, f"tick {message.seq}, but {self._tick} is next")
        self._grant, self.at, self.awaits_states, waits = message, message.t, True, self._waits
        waits.awaited.pop(PLANT, None)
        if self._neighbours_of is not self.meeting.processes:
            for name in set(self._neighbours).difference(self.meeting.processes):
                waits.awaited.pop(name, None)
        waits.deadline = now + waits.timeout
        return self.due(now) is not None if self._leaving else not waits.awaited

    def counts(self, state: State, now: float) -> bool:
        """Whether a state enters the next tick: one of the tick before does; one of this tick waits for the next."""
        name, seq, tick = state.sender, state.seq, self._tick
        if tick is None or seq == tick:
            self._early[name] = state, payload_of(state)
            return False
        if seq > tick:  # the others continue without this agent: a roster without it is on its way
            return False
        if seq != tick - 1:
            raise RejectedError("stale", f"State({seq}) of {name} before tick {tick}")
        self._waits.awaited.pop(name, None)
        return not state.quiet  # no link carries what its law did not send

    def missing(self) -> tuple[Awaited, ...]:
        meeting = self.meeting
        if not self.plant_seen:
            return (Awaited("sign of life", PLANT),)
        if meeting.roster is None:
            return (Awaited("Prepare", PLANT),)
        if not meeting.ready:
            return tuple(Awaited("nameplate", name) for name in meeting.unmet())
        missing = self._waits.missing_messages()  # without a measurement, the states do not matter yet
        return missing[:1] if PLANT in self._waits.awaited else missing

    def passed(self, now: float, unmet: tuple[Awaited, ...] = ()) -> TickVerdict:
        if not self._waits.is_over(now):
            return WAIT
        if self._leaving:
            return TickVerdict("over")
        return TickVerdict("break", self._waits.complaint(self.missing(), now))

    def decide(
        self, agent: Agent, measurement: Measurement | None, decisions: DecisionJournal | None, now: float
    ) -> State:
        """Compute the due tick with the last measurement, or idly without one; then wait for the next."""
        grant, links = self._grant, self._heard.links
        assert grant is not None
        if measurement is None or (links is not None and grant.t in links.pauses):
            state = agent.idle_state(grant)
        else:
            neighbours, seq = self._neighbours, measurement.seq
            if self._neighbours_of is not self.meeting.processes:
                neighbours = tuple(name for name in neighbours if name in self.meeting.processes)
            if measurement is not grant:  # it was long on an emulated link
                measurement = replace(measurement, seq=grant.seq, t=grant.t)
            state = agent.tick(measurement, neighbours)
            if decisions is not None:
                decisions.tick(grant.seq, grant.seq - seq, neighbours)
        self._accounts_due = (grant.seq + 1) % REPORT_TICKS == 0
        # Without links entries are rare, and none may wait: once the plant has the last state, the run is over.
        journal, period_over = self._post.journal, self._accounts_due or now - self._journal_at >= JOURNAL_PERIOD
        if journal is not None and (journal if links is None else period_over):
            self._journal_at = now
            self._reports.journal(grant.t)
        # The next tick needs the states of this one.
        changes = self._post.members.changes
        if self._present[0] != changes or self._neighbours_of is not self.meeting.processes:
            self._neighbours_of, self._neighbours = self.meeting.processes, self.meeting.neighbours
            self._present = changes, self.meeting.present()
        self._grant, self._tick, self.awaits_states, waits = None, grant.seq + 1, self._leaving, self._waits
        waits.awaited = {PLANT: f"Measurement({self._tick})"} | dict.fromkeys(self._present[1], f"State({grant.seq})")
        waits.deadline = now + waits.timeout
        for name in self._early:
            waits.awaited.pop(name, None)
        return state

    def ticked(self, now: float) -> bool:
        """Report on links if that is due, and take the early states of this tick."""
        heard, links = self._heard, self._heard.links
        if self._accounts_due:
            self._reports.links()
        early, self._early = self._early, {}
        for state, payload in early.values():
            if not state.quiet and self._post.admission.is_usable(links, state, payload, state.t):
                heard.keep(state, state.t)
        return False

    def _on_ready(self, number: int, now: float) -> None:
        """Tell the plant that this agent is ready for a roster, by its number, and wait for the next measurement."""
        if self._tick is None:
            self._waits.wait_for({PLANT: "Measurement(0)"}, now)
        post = self._post
        post.send(post.keys.ready(post.name), Ready(sender=post.name, epoch=post.epoch, seq=number, t=self.t))
