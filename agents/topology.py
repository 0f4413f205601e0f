"""The communication graph: a rule turns nameplates into in-neighbours. Pure.

No agent gets a list of neighbours. Each applies the run's rule (`gridpeers.agents.graphs`) to the nameplates of the
agents on the roster, so an agent unknown so far can join. The rules of gridpeers are symmetric: if i listens to j, then
j listens to i. A plugged-in rule need not be. Every link has weight c_ij = 1. In matrices the row is the receiver.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gridpeers.agents.agent_config import Control
from gridpeers.agents.graphs import (
    EdgeList,
    GFM_only,
    Graph,
    Member,
    RosterGraph,
    clustered,
    full,
    make_graph,
    natural_order,
    none,
    ring,
)

__all__ = [
    "adjacency",
    "in_neighbours",
    "is_pairwise",
    "laplacian",
    "link_problems",
    "natural_order",
    "rule_of",
    "without_missing",
]

_OURS: dict[str, Graph] = {"full": full, "none": none, "GFM-only": GFM_only, "clustered": clustered, "ring": ring}


def rule_of(control: Control) -> Graph:
    """Return the rule of a run.

    Raises
    ------
    PluginError
        If it is plugged in, and is missing or cannot be made with its parameters.
    """
    if control.own_graph is not None:
        return make_graph(control.own_graph)
    return EdgeList(control.links) if control.graph == "links" else _OURS[control.graph]


def is_pairwise(control: Control) -> bool:
    """Whether a pair's link depends on the two alone, so that it can be made before the roster is known.

    Examples
    --------
    >>> is_pairwise(Control(secondary="all", graph="ring"))
    False
    """
    return control.own_graph is None and control.graph != "ring"


def in_neighbours(
    control: Control, name: str, members: Mapping[str, Member], rule: Graph | None = None
) -> tuple[str, ...]:
    """Return the agents that an agent listens to.

    Parameters
    ----------
    control : Control
        The run's rule.
    name : str
        The agent; one of `members`.
    members : Mapping[str, Member]
        Nameplates of all agents on the roster, the agent's own included.
    rule : Graph, optional
        Result of `rule_of` for this control, where the caller keeps it.

    Returns
    -------
    tuple[str, ...]
        Names of the in-neighbours, in the order of `members`: sums over them then round alike in every process.

    Raises
    ------
    GraphError
        If the rule is plugged in, and fails or returns no graph.

    Examples
    --------
    >>> from types import SimpleNamespace as Plate
    >>> members = {f"inv{i}": Plate(kind="GFL", microgrid="mg1") for i in (1, 2, 3, 4)}
    >>> in_neighbours(Control(secondary="all", graph="ring"), "inv1", members)
    ('inv2', 'inv4')
    >>> in_neighbours(Control(secondary="all", graph="full", without=(("inv4", "inv1"),)), "inv1", members)
    ('inv2', 'inv3')
    """
    graph = RosterGraph(rule_of(control) if rule is None else rule, members, control.graph)
    return without_missing(control, name, graph.in_neighbours(name))


def without_missing(control: Control, name: str, heard: tuple[str, ...]) -> tuple[str, ...]:
    """Return an agent's in-neighbours by the rule without those whose links to it the case takes out."""
    missing = {pair[0] if pair[1] == name else pair[1] for pair in control.without if name in pair}
    return tuple(other for other in heard if other not in missing) if missing else heard


def link_problems(control: Control, names: Sequence[str]) -> tuple[str, ...]:
    """Return the problems of the listed links, given the names of all inverters.

    Examples
    --------
    >>> control = Control(secondary="all", graph="links", links=(("inv1", "inv9"),))
    >>> link_problems(control, ("inv1", "inv2"))
    ('links[0]: no inverter "inv9"; inverters are inv1, inv2',)
    """
    problems = []
    for i, link in enumerate(control.links):
        unknown = [end for end in dict.fromkeys(link) if end not in names]
        problems += [f'links[{i}]: no inverter "{end}"; inverters are {", ".join(names)}' for end in unknown]
        if link[0] == link[1]:
            problems.append(f"links[{i}]: {link[0]} is linked to itself; a link joins two inverters")
    return tuple(problems)


def adjacency(control: Control, members: Mapping[str, Member]) -> list[list[float]]:
    """Return the adjacency matrix c_ij (1): row i is the receiver, in the order of `members`."""
    names = list(members)
    rows = []
    for name in names:
        heard = set(in_neighbours(control, name, members))
        rows.append([1.0 if other in heard else 0.0 for other in names])
    return rows


def laplacian(control: Control, members: Mapping[str, Member]) -> list[list[float]]:
    """Return the Laplacian diag(A 1) - A of the graph, in the order of `members`.

    Examples
    --------
    >>> from types import SimpleNamespace as Plate
    >>> pair = {"a": Plate(kind="GFM", microgrid="mg1"), "b": Plate(kind="GFL", microgrid="mg1")}
    >>> laplacian(Control(secondary="all", graph="full"), pair)
    [[1.0, -1.0], [-1.0, 1.0]]
    """
    A = adjacency(control, members)
    return [[(sum(row) if i == j else 0.0) - c for j, c in enumerate(row)] for i, row in enumerate(A)]
