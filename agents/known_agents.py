"""The other agents as the agents of one process know them: tokens, nameplates, the last roster and its graph. Pure.

In simulated time, n agents in one process would else keep n copies of n nameplates, and evaluate the rule of the graph
n times for each roster.
"""

from __future__ import annotations

from gridpeers.agents.agent_config import Control
from gridpeers.agents.graphs import RosterGraph, rule_of, without_missing
from gridpeers.wire.membership import Admission, Membership
from gridpeers.wire.messages import Nameplate, Prepare


class KnownAgents:
    """Tokens, nameplates, the last roster and its graph; agents of one process and one rule share them."""

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
