"""An agent under simulated time: it ticks when all messages of a tick are here. Pure; `now` serves deadlines only.

docs/protocol.md has the protocol and why it cannot deadlock: getting ready ("Why each agent asks twice"), what a tick
waits for, and what ends each wait. The agent's deadline is twice the plant's, so that the plant, which sees all agents,
names the culprit.
"""

from __future__ import annotations

from msgspec.structs import replace

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig, Control
from gridpeers.agents.agent_node import AgentNode
from gridpeers.agents.decision_journal import DecisionJournal
from gridpeers.agents.graphs import GraphError, RosterGraph, in_neighbours, is_pairwise, rule_of, without_missing
from gridpeers.agents.laws.law import Law
from gridpeers.wire.codec import RejectedError, decode, encode
from gridpeers.wire.journal import JournalBuffer
from gridpeers.wire.links import REPORT_TICKS, Links
from gridpeers.wire.membership import ASKED_AT_ONCE, Admission, Membership
from gridpeers.wire.messages import PLANT, Measurement, Nameplate, Prepare, Ready, State, Stop, Waiting
from gridpeers.wire.post import Route
from gridpeers.wire.timing import Awaited, TickBarrier, time_of

CLOSING = 2.0
"""Longest wait (s) for the neighbours' last states, and for the acknowledgement of the report on emulated links."""

JOURNAL_PERIOD = 0.2
"""Longest time (s) until a part of the journal is sent, where emulated links change all the time how it decides."""

DEADLINES = 2.0
"""An agent waits this many deadlines, so that the plant reports the error first."""


class KnownAgents:
    """The other agents as agents know them: tokens, nameplates, the last roster and its graph.

    The agents of one process and one rule share them: else n agents would keep n copies of n nameplates, and evaluate
    the rule n times for each roster.
    """

    def __init__(self, control: Control) -> None:
        self.control = control
        self.members = Membership(Admission())
        self._rule = rule_of(control)
        self._own: dict[str, Nameplate] = {}
        self._latest: tuple[Prepare | None, dict[str, str]] = None, {}
        self._taken: Prepare | None = None
        self._graph: RosterGraph | None = None
        self._unmet: tuple[int, list[str]] = -1, []
        """Number of changes of the members by then, and the names on the roster without a nameplate."""

    def add(self, nameplate: Nameplate) -> None:
        self._own[nameplate.sender] = nameplate

    def processes(self, message: Prepare) -> dict[str, str]:
        """Return the process of each name on a roster, in the order of the inverters; for one message one object."""
        if message is not self._latest[0]:
            self._latest = message, dict(zip(message.roster, message.instances, strict=True))
        return self._latest[1]

    def take(self, message: Prepare) -> None:
        if message is self._taken:
            return
        self._taken, self._graph, self._unmet = message, None, (-1, [])
        for name, instance in self.processes(message).items():
            self.members.prefer(name, instance)

    def unmet(self, own: str) -> list[str]:
        """Return the members of the roster, but for the own agent, whose nameplates are missing."""
        changes, names = self._unmet
        if changes != self.members.changes:
            met, counts = self.members.nameplates, self.members.instance
            names = [name for name, instance in self._latest[1].items() if name not in met or counts(name) != instance]
            self._unmet = self.members.changes, names
        return [name for name in names if name != own] if names else names

    def nameplate(self, name: str) -> Nameplate:
        return self.members.nameplates.get(name) or self._own[name]

    def in_neighbours(self, own: str) -> tuple[str, ...]:
        """Return the in-neighbours of an agent, once all on the roster are met; raise GraphError if the rule fails."""
        if self._graph is None:
            roster = {name: self.nameplate(name) for name in self._latest[1]}
            self._graph = RosterGraph(self._rule, roster, self.control.graph)
        return without_missing(self.control, own, self._graph.in_neighbours(own))


class LockstepAgent(AgentNode):
    """One agent under simulated time; parameters as of `AgentNode`, and `known`.

    `known` is what the agents of this process know of the others; by default this agent shares it with nobody.
    """

    def __init__(
        self,
        config: AgentConfig,
        instance: str,
        links: Links | None = None,
        law: Law | None = None,
        known: KnownAgents | None = None,
    ) -> None:
        self._known = KnownAgents(config.control) if known is None else known
        super().__init__(config, instance, links, law, self._known.members)
        self._known.add(self._agent.nameplate)
        if config.clock_rate != 1.0:  # its periods seem longer to it than they are
            self._agent = Agent(config.by_own_clock(), law)
        if config.record != "physics":
            self.post.journal = JournalBuffer()
            self._decisions = DecisionJournal(self._agent, self.post.journal)
        self.routes[self.keys.control] = Route(PLANT, (Prepare, Waiting, Stop), self._on_control)
        self._barrier = TickBarrier(config.name, DEADLINES * config.deadline)
        self._last_heard = self._barrier.last_heard = self.post.last_heard
        self._pairwise = is_pairwise(config.control)
        self._roster: Prepare | None = None
        self._processes: dict[str, str] = {}
        self._ready = False
        """Whether the agent is ready for this roster. It stays so if an agent dies: the next roster changes it."""
        self._proofs: dict[tuple[str, str], bool] = {}
        """Processes asked for proof that they know of the subscription to them; True once they have answered."""
        self._answered = False
        self._unproven: dict[str, str] | None = None
        """In-neighbours on the roster whose processes have not answered; None until the whole roster has been met."""
        self._roster_neighbours: tuple[str, ...] = ()
        self._tick: int | None = None
        self._grant: Measurement | None = None
        self._states_on: dict[str, str] = {}
        self._early: dict[str, tuple[State, bytes]] = {}
        """States of this tick that arrived before it was done, and their bytes."""
        self._neighbours: tuple[str, ...] = ()
        self._neighbours_of: dict[str, str] = {}
        self._present: tuple[int, dict[str, str], tuple[str, ...]] = -1, {}, ()
        """Changes of the members by then, the roster, and the in-neighbours whose processes on it count."""
        self._journal_at = 0.0
        self._ending = ""
        self._reported = False

    @property
    def publications(self) -> tuple[str, ...]:
        keys, name = self.keys, self.name
        return keys.ready(name), keys.state(name), keys.report(name), keys.journal(name)

    @property
    def messages_needed(self) -> int:
        return self._barrier.messages_needed

    @property
    def deadline(self) -> float | None:
        return self._barrier.deadline

    def note_siblings(self, names: frozenset[str]) -> None:
        self._barrier.siblings = names

    def start(self, now: float) -> None:
        self._barrier.renew(now)
        self._barrier.deadline = max(self._barrier.deadline or 0.0, now + self._config.plant_wait)

    def missing_messages(self) -> tuple[Awaited, ...]:
        if not self.plant_seen:
            return (Awaited("sign of life", PLANT),)
        if self._roster is None:
            return (Awaited("Prepare", PLANT),)
        if not self._ready:
            return tuple(Awaited("nameplate", name) for name in self._known.unmet(self.name) or self._unproven or ())
        missing = self._barrier.missing_messages()  # without a measurement, the states do not matter yet
        return missing[:1] if self._barrier.awaits(PLANT) else missing

    def expire(self, now: float) -> None:
        if self.finished or not self._barrier.is_over(now):
            return
        if self._ending:
            self._report_the_last()
            self.stopped = self._ending
        else:
            self.failed = self._barrier.complaint(self.missing_messages(), now)

    def _plant_came(self, now: float) -> None:
        # The plant may compile, or wait for agents yet to start. If it dies, its token vanishes and ends this wait.
        self._barrier.rest()

    def _plant_gone(self, now: float) -> None:
        if self._ending:
            self.stopped = self._ending
        elif not self.finished:
            tick = "" if self._tick is None else f" at tick {self._tick}"
            self.failed = f"{self.name}: the plant is gone{tick}; the run has ended"

    def vanished(self, key: str, now: float) -> None:
        match self.keys.parts(key):
            case ("alive", "agent", name, instance):
                if self.post.process_gone(name, instance) or self._processes.get(name) == instance:
                    self._agent_gone(name, instance, now)
            case _:
                super().vanished(key, now)

    def _agent_gone(self, name: str, instance: str, now: float) -> None:
        self.admission.release(name)
        self._proofs.pop((name, instance), None)
        if self._barrier.awaits(name):
            self._barrier.came(name)
            self._compute(now)

    def received(self, key: str, payload: bytes, now: float) -> None:
        """Take a message; a state before the next measurement is here takes a shorter way, with the same checks.

        Of n agents that hear each other, each takes n - 1 states a tick, and in one process all of them so.
        """
        name = self._states_on.get(key)
        if (
            name is not None
            and self._grant is None
            and not self._ending
            and (self._links is None or name in self._links.clear)  # no fault ever acts on its link
        ):
            try:
                message = decode(payload)
            except RejectedError:
                message = None
            if (
                type(message) is State
                and message.sender == name
                and message.seq + 1 == self._tick
                and not (message.idle or message.quiet)
                and self.admission.passes(message)  # the epoch too
            ):
                self._barrier.came(name)
                self._agent.hear(message)
                self._last_heard[name] = message.seq, now
                return
        super().received(key, payload, now)

    def _on_control(self, message: Prepare | Waiting | Stop, payload: bytes, now: float) -> None:
        if isinstance(message, Stop):
            self._end(message.reason, now)
        elif isinstance(message, Waiting):
            self._barrier.renew(now)
        elif message == self._roster:
            self._barrier.renew(now)
            self._ask_again()
        else:
            self._prepare(message)
            self._barrier.renew(now)
            self._get_ready(now)

    def _ask_again(self) -> None:
        """Answer a `Prepare` that is sent again: with `Ready` once more, or by questions if no answer comes."""
        if self._ready:
            self._send_ready()
        elif not self._answered:
            unproven = list((self._unproven or {}).items())[:ASKED_AT_ONCE]
            for name, instance in unproven or self.members.next_unmet():
                self.post.ask(name, instance)
        self._answered = False

    def _on_stop_request(self, message: Stop, payload: bytes, now: float) -> None:
        if message.refused:
            self.failed = message.reason
        else:
            self._end(message.reason, now)

    def _end(self, reason: str, now: float) -> None:
        """Close; with emulated links only once their account has the neighbours' last states, and the plant has it."""
        if self._links is None or self._ending:
            self.stopped = self._ending or reason
            return
        self._ending = reason
        self._barrier.deadline = now + CLOSING
        self._compute(now)

    def _report_the_last(self) -> None:
        if not self._reported:
            self._reported = True
            self._publish_decisions()
            self._report_links(final=True)

    def _on_nameplate(self, instance: str, nameplate: Nameplate, first: bool, now: float) -> None:
        self._answered = True
        name = nameplate.sender
        process = name, instance
        if process in self._proofs:
            self._proofs[process] = True
            if self._unproven and self._unproven.get(name) == instance:
                del self._unproven[name]
        elif self._pairwise and self.members.instance(name) == instance:
            pair = {self.name: self._agent.nameplate, name: nameplate}
            if in_neighbours(self._config.control, self.name, pair):
                self._ask_for_proof(name)
        self._get_ready(now)

    def _prepare(self, message: Prepare) -> None:
        if self._roster is not None and message.seq <= self._roster.seq:
            raise RejectedError("stale", f"roster {message.seq}, {self._roster.seq} is known")
        instances = self._known.processes(message)
        if instances.get(self.name) != self._instance:
            raise RejectedError("unexpected", f"roster {message.seq} is without this process")
        self._roster, self._processes, self._ready, self._unproven = message, instances, False, None
        self._known.take(message)

    def _ask_for_proof(self, name: str) -> None:
        """Listen to an agent, and ask it for proof that it knows of the subscription."""
        instance = self.members.instance(name)
        self.admission.bind(name, self._known.nameplate(name).epoch)
        self._proofs[name, instance] = False
        self._listen_to(name)
        self._states_on[self.keys.state(name)] = name
        self.post.ask(name, instance)

    def _meet_neighbours(self) -> dict[str, str]:
        """Note the in-neighbours on the roster; return those without proof that they know of the subscription."""
        neighbours: tuple[str, ...] = ()
        self._agent.graph_error = ""
        try:
            neighbours = self._known.in_neighbours(self.name)
        except GraphError as error:
            self._agent.graph_error = str(error)
        for name in neighbours:
            nameplate = self._known.nameplate(name)
            self._agent.meet(nameplate)
            self.admission.bind(name, nameplate.epoch)
        self._roster_neighbours = neighbours
        return {
            name: self._processes[name] for name in neighbours if not self._proofs.get((name, self._processes[name]))
        }

    def _get_ready(self, now: float) -> None:
        """Ask the in-neighbours of this roster for proof; send `Ready` once nothing is missing."""
        if self._roster is None or self._ready or self._unproven:
            return
        if self._unproven is None:
            if self._known.unmet(self.name):
                return
            self._unproven = self._meet_neighbours()
            for name, instance in self._unproven.items():
                if (name, instance) not in self._proofs:
                    self._ask_for_proof(name)
            if self._unproven:
                return
        self._ready = True
        if self._tick is None:
            self._barrier.wait_for({PLANT: "Measurement(0)"}, now)
        else:
            self._barrier.renew(now)
        self._send_ready()

    def _send_ready(self) -> None:
        assert self._roster is not None
        t = time_of(self._tick or 0, self._config.T_c)
        ready = Ready(sender=self.name, epoch=self._config.epoch, seq=self._roster.seq, t=t)
        self.post.publish(self.keys.ready(self.name), encode(ready))

    def _on_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        if not self._ready:
            raise RejectedError("unexpected", "no roster has this process on it")
        if self._tick is None:
            if abs(message.t - time_of(message.seq, self._config.T_c)) > self._config.T_c / 2:
                raise RejectedError("implausible", f"tick {message.seq} at t = {message.t:g} s")
            self._tick = message.seq
            self._early = {name: early for name, early in self._early.items() if early[0].seq == message.seq}
        if message.seq != self._tick or self._grant is not None:
            kind = "unexpected" if message.seq > self._tick else "stale"
            raise RejectedError(kind, f"tick {message.seq}, but {self._tick} is next")
        self._grant = message
        self._barrier.came(PLANT)
        if self._neighbours_of is not self._processes:
            for name in set(self._neighbours).difference(self._processes):
                self._barrier.came(name)
        self._hear(message, payload, message.t)
        self._barrier.renew(now)
        self._compute(now)

    def _on_state(self, message: State, payload: bytes, now: float) -> None:
        name, seq, tick = message.sender, message.seq, self._tick
        if tick is None or seq == tick:
            self._early[name] = message, payload
            return
        if seq > tick:  # the others continue without this agent: a roster without it is on its way
            return
        if seq != tick - 1:
            raise RejectedError("stale", f"State({seq}) of {name} before tick {tick}")
        self._barrier.came(name)
        if not message.quiet:  # no link carries what its law did not send
            self._hear(message, payload, message.t)
        if (self._grant is not None and self._barrier.is_open) or self._ending:
            self._compute(now)

    def _keep(self, message: State | Measurement, at: float) -> None:
        if type(message) is State:  # by its tick its age is known: nothing asks when it arrived
            self._agent.hear(message)
        else:
            super()._keep(message, at)

    def _compute(self, now: float) -> None:
        """Compute and send the next tick, if no message is missing."""
        if self._ending:
            if not any(self._barrier.awaits(name) for name in self._neighbours):
                self._report_the_last()
            return
        grant = self._grant
        if grant is None or not self._barrier.is_open:
            return
        self._hear_late(grant.t)
        measured = self.states.measured(grant.t, self._config.max_age)
        if measured is None or (self._links is not None and self._links.stalled(grant.t)):
            state = self._agent.idle_state(grant)
        else:
            neighbours = self._neighbours
            if self._neighbours_of is not self._processes:
                neighbours = tuple(name for name in neighbours if name in self._processes)
            seq = measured.seq
            if measured is not grant:
                measured = replace(measured, seq=grant.seq, t=grant.t)
            state = self._agent.tick(measured, neighbours)
            noted = self.post.journal is not None and self._decisions.tick(grant.seq, grant.seq - seq, neighbours)
            if noted and self._links is None:
                # Entries are rare then, and none may wait: once the plant has the last state, the run is over.
                self._publish_decisions()
        self.post.publish(self.keys.state(self.name), encode(state))
        reports = (grant.seq + 1) % REPORT_TICKS == 0
        if self._links is not None and (reports or now - self._journal_at >= JOURNAL_PERIOD):
            self._journal_at = now
            self._publish_decisions()
        if reports:
            self._report_links()
        self._await_next(grant, now)

    def _publish_decisions(self) -> None:
        """Send the journal; with emulated links an empty one too, as it says up to when nothing has changed."""
        t = time_of(self._tick or 0, self._config.T_c)
        for part in self.post.take_journal(t, empty=self._links is not None):
            self.post.publish(self.keys.journal(self.name), encode(part))

    def _await_next(self, grant: Measurement, now: float) -> None:
        """Start the wait for the next tick: it needs the states of this one, and some may be here already."""
        if self._processes is not self._neighbours_of:
            self._neighbours_of, self._neighbours = self._processes, self._roster_neighbours
        early, self._early = self._early, {}
        self._grant, self._tick = None, grant.seq + 1
        if self._present[0] != self.members.changes or self._present[1] is not self._processes:
            here = tuple(name for name in self._neighbours if self.members.instance(name) == self._processes.get(name))
            self._present = self.members.changes, self._processes, here
        awaited = {PLANT: f"Measurement({self._tick})"} | dict.fromkeys(self._present[2], f"State({grant.seq})")
        for name in early:
            awaited.pop(name, None)
        self._barrier.wait_for(awaited, now)
        for state, payload in early.values():
            if not state.quiet:
                self._hear(state, payload, state.t)
