"""The communication graph: a rule, applied to nameplates, says who listens to whom.

No agent is told its neighbours. Each applies the run's rule to the nameplates of the agents on the roster, so an agent
that nobody has heard of can join. All rules are symmetric: who listens to somebody is heard by it. Every link has
weight c_ij = 1. In matrices the row is the receiver.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

from agents.config import Control, GraphRule

Links = frozenset[tuple[str, str]]


class Member(Protocol):
    """What the rules look at; a `wire.messages.Nameplate` has it."""

    @property
    def kind(self) -> str:
        """Whether "GFM" or "GFL"."""
        ...

    @property
    def microgrid(self) -> str:
        """Name of the microgrid."""
        ...


def natural_order(name: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key in which inv2 comes before inv10.

    Examples
    --------
    >>> sorted(["inv10", "inv2", "inv1"], key=natural_order)
    ['inv1', 'inv2', 'inv10']
    """
    parts = re.findall(r"\d+|\D+", name)
    return tuple((0, int(part), part) if part.isascii() and part.isdigit() else (1, 0, part) for part in parts)


def _full(a: Member, b: Member) -> bool:
    return True


def _none(a: Member, b: Member) -> bool:
    return False


def _GFM_only(a: Member, b: Member) -> bool:
    return a.kind == b.kind == "GFM"


def _clustered(a: Member, b: Member) -> bool:
    return a.microgrid == b.microgrid or a.kind == b.kind == "GFM"


_PAIRWISE: dict[GraphRule, Callable[[Member, Member], bool]] = {
    "full": _full,
    "none": _none,
    "GFM-only": _GFM_only,
    "clustered": _clustered,
}
"""Rules that look at two nameplates and at nobody else."""


def is_pairwise(control: Control) -> bool:
    """Whether a pair's link depends on the two alone, so that it can be made before the roster is known.

    Examples
    --------
    >>> is_pairwise(Control(secondary="all", graph="ring"))
    False
    """
    return control.graph != "ring"


def in_neighbours(control: Control, name: str, members: Mapping[str, Member]) -> tuple[str, ...]:
    """Whom an agent listens to.

    Parameters
    ----------
    control : Control
        The run's rule.
    name : str
        The agent; one of `members`.
    members : Mapping[str, Member]
        Nameplates of everybody on the roster, the agent's own included.

    Returns
    -------
    tuple[str, ...]
        Names of the in-neighbours, in the order of `members`: sums over them then round alike in every process.

    Examples
    --------
    >>> from types import SimpleNamespace as Plate
    >>> members = {f"inv{i}": Plate(kind="GFL", microgrid="mg1") for i in (1, 2, 3, 4)}
    >>> in_neighbours(Control(secondary="all", graph="ring"), "inv1", members)
    ('inv2', 'inv4')
    >>> in_neighbours(Control(secondary="all", graph="full", without=(("inv4", "inv1"),)), "inv1", members)
    ('inv2', 'inv3')
    """
    missing = _both_ways(control.without)
    others = [other for other in members if other != name and (name, other) not in missing]
    if control.graph == "ring":
        ring = sorted(members, key=natural_order)
        at = ring.index(name)
        beside = {ring[at - 1], ring[(at + 1) % len(ring)]}
        return tuple(other for other in others if other in beside)
    if control.graph == "links":
        links = _both_ways(control.links)
        return tuple(other for other in others if (name, other) in links)
    linked, own = _PAIRWISE[control.graph], members[name]
    return tuple(other for other in others if linked(own, members[other]))


def _both_ways(links: Iterable[tuple[str, str]]) -> Links:
    return frozenset(pair for a, b in links for pair in ((a, b), (b, a)))


def link_mistakes(control: Control, names: Sequence[str]) -> tuple[str, ...]:
    """What is wrong with the listed links, given the names of all inverters; empty if nothing is.

    Examples
    --------
    >>> control = Control(secondary="all", graph="links", links=(("inv1", "inv9"),))
    >>> link_mistakes(control, ("inv1", "inv2"))
    ('links[0]: no inverter "inv9"; inverters are inv1, inv2',)
    """
    mistakes = []
    for i, link in enumerate(control.links):
        unknown = [end for end in dict.fromkeys(link) if end not in names]
        mistakes += [f'links[{i}]: no inverter "{end}"; inverters are {", ".join(names)}' for end in unknown]
        if link[0] == link[1]:
            mistakes.append(f"links[{i}]: {link[0]} is linked to itself; a link joins two inverters")
    return tuple(mistakes)


def adjacency(control: Control, members: Mapping[str, Member]) -> list[list[float]]:
    """Adjacency matrix c_ij (1): row i is the receiver, in the order of `members`."""
    names = list(members)
    rows = []
    for name in names:
        heard = set(in_neighbours(control, name, members))
        rows.append([1.0 if other in heard else 0.0 for other in names])
    return rows


def laplacian(control: Control, members: Mapping[str, Member]) -> list[list[float]]:
    """Laplacian diag(A 1) - A of the graph, in the order of `members`.

    Examples
    --------
    >>> from types import SimpleNamespace as Plate
    >>> pair = {"a": Plate(kind="GFM", microgrid="mg1"), "b": Plate(kind="GFL", microgrid="mg1")}
    >>> laplacian(Control(secondary="all", graph="full"), pair)
    [[1.0, -1.0], [-1.0, 1.0]]
    """
    A = adjacency(control, members)
    return [[(sum(row) if i == j else 0.0) - c for j, c in enumerate(row)] for i, row in enumerate(A)]
