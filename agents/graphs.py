"""Rules of the communication graph: functions from nameplates to neighbours, and the registry of them.

    @gridpeers.graph("star")
    def star(members):
        '''All agents listen to inv1, and inv1 to all.'''
        return {name: set(members) - {name} if name == "inv1" else {"inv1"} for name in members}

The argument of a rule is the nameplates of all agents on the roster, by name in natural order; it returns the
in-neighbours of each. Every agent applies it by itself: the same nameplates must give the same graph. A class with
parameters (annotated attributes, `docs/how-to/plug-ins.md`) and a method `__call__(self, members)` is a rule too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Annotated, Any, Protocol

from gridpeers.agents.agent_config import Control
from gridpeers.wire.plugins.plugin import Plugin, callable_objection, made
from gridpeers.wire.plugins.registry import ANYTHING, PluginError, Registry, line_of, named
from gridpeers.wire.wording import printable, suggestion


class Member(Protocol):
    """The part of a nameplate that rules use; a `gridpeers.wire.messages.Nameplate` has it."""

    @property
    def kind(self) -> str: ...
    @property
    def microgrid(self) -> str: ...
    @property
    def P_rated(self) -> float: ...
    @property
    def V_nom(self) -> float: ...
    @property
    def m_p(self) -> float: ...
    @property
    def m_q(self) -> float: ...


Members = Mapping[str, Member]

Graph = Callable[[Members], Mapping[str, Iterable[str]]]
"""From nameplates to each agent's in-neighbours; an agent without an entry has none."""


class GraphError(ValueError):
    """A rule raised an error, or returned no graph."""


@lru_cache(maxsize=8192)
def natural_order(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key in which inv2 comes before inv10."""
    parts = re.findall(r"\d+|\D+", name)
    return tuple((0, int(part), part) if part.isascii() and part.isdigit() else (1, 0, part) for part in parts)


class PairRule:
    """A rule by pairs: an agent evaluates its own pairs alone, so its cost grows with the roster and not its square."""

    def __init__(self, text: str, linked: Callable[[Member, Member], bool]) -> None:
        self.__doc__, self._linked = text, linked

    def __call__(self, members: Members) -> Mapping[str, Iterable[str]]:
        return {name: self.neighbours(name, members) for name in members}

    def neighbours(self, own: str, members: Members) -> tuple[str, ...]:
        nameplate = members[own]
        return tuple(name for name, other in members.items() if name != own and self._linked(nameplate, other))


full = PairRule("Let every agent listen to all others.", lambda a, b: True)
none = PairRule("Let no agent listen to any other.", lambda a, b: False)
GFM_only = PairRule("Let the grid-forming inverters listen to each other.", lambda a, b: a.kind == b.kind == "GFM")
clustered = PairRule(
    "Let the inverters of a microgrid listen to each other, and all grid-forming ones too.",
    lambda a, b: a.microgrid == b.microgrid or a.kind == b.kind == "GFM",
)


def ring(members: Members) -> Mapping[str, Iterable[str]]:
    """Let each agent listen to the previous and the next one, in natural order of the names."""
    names = sorted(members, key=natural_order)
    return {name: {names[i - 1], names[(i + 1) % len(names)]} - {name} for i, name in enumerate(names)}


class EdgeList:
    links: Annotated[tuple[tuple[str, str], ...], "Pairs; written as the case's own key `links`."] = ()

    def __init__(self, links: Iterable[tuple[str, str]] = ()) -> None:
        self.links = tuple(links)

    def __call__(self, members: Members) -> Mapping[str, Iterable[str]]:
        both = [pair for a, b in self.links for pair in ((a, b), (b, a))]
        return {name: {b for a, b in both if a == name and b in members} for name in members}


GRAPHS: Registry[Any] = Registry(
    "graph",
    "graphs",
    lambda it: callable_objection(it, "members"),
    own={
        "full": "gridpeers.agents.graphs:full",
        "none": "gridpeers.agents.graphs:none",
        "GFM-only": "gridpeers.agents.graphs:GFM_only",
        "clustered": "gridpeers.agents.graphs:clustered",
        "ring": "gridpeers.agents.graphs:ring",
        "links": "gridpeers.agents.graphs:EdgeList",
    },
)


def check_graph(rule: Graph, members: Members, name: str) -> None:
    """Raise GraphError if a rule, by its name in the scenario, raises, or its result is no graph of these agents.

    In a run a name that is no member is left out: in real time agents meet one after the other.
    """
    for one, heard in _evaluated(rule, members, name).items():
        if one not in members:
            raise GraphError(f"graph {name} names {_shown(one)}, {_unknown(one, members)}")
        for other in sorted(heard, key=str):
            if other not in members:
                raise GraphError(f"graph {name} lets {one} listen to {_shown(other)}, {_unknown(other, members)}")
            if other == one:
                raise GraphError(f"graph {name} lets {one} listen to itself; leave it out of its own neighbours")


class RosterGraph:
    """The graph on one roster, agent by agent. A rule by pairs costs one row, any other is evaluated once for all."""

    def __init__(self, rule: Graph, members: Members, name: str) -> None:
        self._rule, self._members, self._name = rule, members, name
        self._heard_by: dict[str, frozenset[str]] | None = None
        self._error = ""
        self._place: dict[str, int] = {}

    def in_neighbours(self, own: str) -> tuple[str, ...]:
        """Return an agent's in-neighbours, in the order of the members; raise GraphError if the rule fails."""
        if isinstance(self._rule, PairRule):
            return self._rule.neighbours(own, self._members)
        if self._error:
            raise GraphError(self._error)
        if self._heard_by is None:
            try:
                self._heard_by = _evaluated(self._rule, self._members, self._name)
            except GraphError as error:
                self._error = str(error)
                raise
            self._place = {name: i for i, name in enumerate(self._members)}
        heard = (other for other in self._heard_by.get(own, ()) if other != own and other in self._place)
        return tuple(sorted(heard, key=self._place.__getitem__))


def _evaluated(rule: Graph, members: Members, name: str) -> dict[str, frozenset[str]]:
    ordered = {one: members[one] for one in sorted(members, key=natural_order)}
    try:
        result = rule(ordered)
        return {one: frozenset(result[one]) for one in result}
    except ANYTHING as error:  # a rule is foreign code
        members_of = ", ".join(ordered)
        raise GraphError(f"graph {name}{line_of(rule, error)} of {members_of} failed: {named(error)}") from error


def make_graph(plugin: Plugin) -> Graph:
    rule = made(GRAPHS, plugin)
    if not callable(rule):
        raise PluginError(f"{plugin.use}: an instance of its class cannot be called with the members' nameplates")
    return rule  # type: ignore[no-any-return]


def _unknown(name: Any, members: Members) -> str:
    return f"which is no agent of the run; {suggestion(str(name), members, 'agents')}"


def _shown(name: Any) -> str:
    return name if isinstance(name, str) and name.isprintable() else printable(repr(name), 60)


def rule_of(control: Control) -> Graph:
    """Return the rule of a run; raise PluginError if a plugged-in one is missing or cannot be made."""
    if control.own_graph is not None:
        return make_graph(control.own_graph)
    rule: Graph = EdgeList(control.links) if control.graph == "links" else GRAPHS.resolve(control.graph)
    return rule


def is_pairwise(control: Control) -> bool:
    """Return whether two agents know that they are linked before they know the others."""
    return control.own_graph is None and control.graph != "ring"


def in_neighbours(
    control: Control, name: str, members: Mapping[str, Member], rule: Graph | None = None
) -> tuple[str, ...]:
    """Return the agents that an agent listens to by the run's rule, in the order of `members`: sums then round alike.

    `members` are all on the roster, the own one included; `rule` is `rule_of(control)` where the caller keeps it.
    Raise GraphError if a plugged-in rule fails or returns no graph.
    """
    graph = RosterGraph(rule_of(control) if rule is None else rule, members, control.graph)
    return without_missing(control, name, graph.in_neighbours(name))


def without_missing(control: Control, name: str, heard: tuple[str, ...]) -> tuple[str, ...]:
    """Return the in-neighbours of an agent by the rule, without the links that the case removes."""
    missing = {pair[0] if pair[1] == name else pair[1] for pair in control.without if name in pair}
    return tuple(other for other in heard if other not in missing) if missing else heard
