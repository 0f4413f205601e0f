"""How an agent in simulated time gets ready for a roster: it meets all members, and has proof that it hears some. Pure.

docs/reference/protocol.md says why each in-neighbour is asked twice ("Why an agent asks twice").
"""

from __future__ import annotations

from collections.abc import Callable

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import Control
from gridpeers.agents.graphs import GraphError, RosterGraph, in_neighbours, is_pairwise, rule_of, without_missing
from gridpeers.wire.codec import RejectedError
from gridpeers.wire.membership import ASKED_AT_ONCE, Admission, Membership
from gridpeers.wire.messages import Nameplate, Prepare, State
from gridpeers.wire.phases import Phases
from gridpeers.wire.post import Handler, Post, Route


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
        """The last roster, and the process of each name on it; for one message one object."""
        self._taken: Prepare | None = None
        self._graph: RosterGraph | None = None
        self._unmet: tuple[int, list[str]] = -1, []
        """Number of changes of the members by then, and the names on the roster without a nameplate."""

    def add(self, nameplate: Nameplate) -> None:
        self._own[nameplate.sender] = nameplate

    def processes(self, message: Prepare) -> dict[str, str]:
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


class RosterMeeting:
    """The roster of one agent, and what is missing until it is `ready` for it; states go to `on_state`.

    It stays ready if an agent dies: the next roster changes that.
    """

    def __init__(
        self, post: Post, phases: Phases, known: KnownAgents, agent: Agent, instance: str, on_state: Handler
    ) -> None:
        self._post, self._phases, self._known, self._agent, self._instance = post, phases, known, agent, instance
        self._on_state = on_state
        self.on_ready: Callable[[int, float], None]
        """Takes the number of a roster for which the agent is ready, and the time; again if the plant asks again."""
        self._pairwise = is_pairwise(known.control)
        self.roster: Prepare | None = None
        self.processes: dict[str, str] = {}
        self.neighbours: tuple[str, ...] = ()
        """In-neighbours on the roster."""
        self.ready = False
        self._proofs: dict[tuple[str, str], bool] = {}
        """Processes asked for proof that they know of the subscription to them; True once they have answered."""
        self._answered = False
        self._unproven: dict[str, str] | None = None
        """In-neighbours on the roster whose processes have not answered; None until the whole roster has been met."""

    def on_prepare(self, message: Prepare, now: float) -> None:
        """Begin to get ready for a new roster; raise RejectedError if it is old, or without this process."""
        if message == self.roster:
            self._ask_again(now)
            return
        if self.roster is not None and message.seq <= self.roster.seq:
            raise RejectedError("stale", f"roster {message.seq}, but roster {self.roster.seq} is known")
        processes = self._known.processes(message)
        if processes.get(self._post.name) != self._instance:
            raise RejectedError("unexpected", f"roster {message.seq} is without this process")
        if not self._phases.allows("roster"):
            raise RejectedError("unexpected", f"roster {message.seq}, but this agent leaves the run")
        self.roster, self.processes, self.ready, self._unproven = message, processes, False, None
        self._known.take(message)
        self._phases.on("roster")
        self._get_ready(now)

    def _ask_again(self, now: float) -> None:
        """Answer a roster that is sent again: with `Ready` once more, or by questions if no answer comes."""
        if self.ready and self.roster is not None:
            self.on_ready(self.roster.seq, now)
        elif not self._answered:
            unproven = list((self._unproven or {}).items())[:ASKED_AT_ONCE]
            for name, instance in unproven or self._known.members.next_unmet():
                self._post.ask(name, instance)
        self._answered = False

    def on_nameplate(self, instance: str, nameplate: Nameplate, first: bool, now: float) -> None:
        """Note a nameplate, which is proof if it was asked for after the subscription."""
        self._answered = True
        name = nameplate.sender
        if (name, instance) in self._proofs:
            self._proofs[name, instance] = True
            if self._unproven and self._unproven.get(name) == instance:
                del self._unproven[name]
        elif self._pairwise and self._known.members.instance(name) == instance:
            pair = {self._post.name: self._agent.nameplate, name: nameplate}
            if in_neighbours(self._known.control, self._post.name, pair):
                self._ask_for_proof(name)
        self._get_ready(now)

    def gone(self, name: str, instance: str) -> bool:
        """Note that a process is gone; return whether it counted, or is on the roster."""
        if not (self._post.process_gone(name, instance) or self.processes.get(name) == instance):
            return False
        self._post.admission.release(name)
        self._proofs.pop((name, instance), None)
        return True

    def _get_ready(self, now: float) -> None:
        """Ask the in-neighbours of this roster for proof; be ready once nothing is missing, unless the agent leaves."""
        if self.roster is None or self._unproven or not self._phases.allows("ready"):
            return
        if self._unproven is None:
            if self._known.unmet(self._post.name):
                return
            self._unproven = self._meet_neighbours()
            for name, instance in self._unproven.items():
                if (name, instance) not in self._proofs:
                    self._ask_for_proof(name)
            if self._unproven:
                return
        self.ready = True
        self._phases.on("ready")
        self.on_ready(self.roster.seq, now)

    def unmet(self) -> list[str]:
        """Return the agents whose nameplates are missing, as such or as proof."""
        return self._known.unmet(self._post.name) or list(self._unproven or ())

    def present(self) -> tuple[str, ...]:
        """Return the in-neighbours whose processes on the roster are here."""
        members = self._known.members
        return tuple(name for name in self.neighbours if members.instance(name) == self.processes.get(name))

    def _ask_for_proof(self, name: str) -> None:
        """Listen to an agent, and ask it for proof that it knows of the subscription."""
        post, instance = self._post, self._known.members.instance(name)
        post.admission.bind(name, self._known.nameplate(name).epoch)
        self._proofs[name, instance] = False
        post.listen(post.keys.state(name), Route(name, (State,), self._on_state))
        post.ask(name, instance)

    def _meet_neighbours(self) -> dict[str, str]:
        """Note the in-neighbours on the roster; return those without proof that they know of the subscription."""
        self.neighbours, self._agent.graph_error = (), ""
        try:
            self.neighbours = self._known.in_neighbours(self._post.name)
        except GraphError as error:
            self._agent.graph_error = str(error)
        for name in self.neighbours:
            nameplate = self._known.nameplate(name)
            self._agent.meet(nameplate)
            self._post.admission.bind(name, nameplate.epoch)
        processes = self.processes
        return {name: processes[name] for name in self.neighbours if not self._proofs.get((name, processes[name]))}
