"""Parts of a circuit that nothing feeds, and nodes that nothing holds: no voltage can be told there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from plant.equipment import NODES, Feeder, Source, Switch
from plant.imported_equipment import LinearElement, LoadPart
from plant.network import Network

Node = tuple[str, str]

BEYOND = 100.0
"""Voltage without load (pu) that only a singular matrix gives."""

SHOWN = 5
"""How many buses of a floating section a problem names."""


def report_unconnected(
    rows: list[LinearElement], switches: list[Switch], parts: list[LoadPart], source: Source, problems: list[str]
) -> None:
    """Add a problem for each node that loads alone lead to, and each section without the source, switches closed.

    Parameters
    ----------
    rows, switches, parts, source
        What the circuit consists of.
    problems
        Takes the problems.
    """
    graph: dict[Node, set[Node]] = {}
    held: set[Node] = set()
    for row in rows:
        for node, values in zip(row.nodes, row.Y, strict=True):
            coupled = [other for other, value in zip(row.nodes, values, strict=True) if value]
            graph.setdefault(node, set()).update(coupled)
            for other in coupled:
                graph.setdefault(other, set()).add(node)
            if coupled:
                held.add(node)
    for switch in switches:
        for letter in switch.phases:
            _join(graph, (switch.from_bus, letter), (switch.to_bus, letter))
    alone: dict[tuple[str, str], dict[int, None]] = {}
    for part in parts:
        for letter in part.ends:
            if letter and (part.bus, letter) not in held:
                alone.setdefault((part.name, part.bus), {})[_number(letter)] = None
    for (name, bus), numbers in alone.items():
        problems.append(
            f"{name}: node {', '.join(map(str, sorted(numbers)))} of bus {bus} is connected to nothing but loads: a "
            "phase that does not come there, or an open neutral; connect or ground it"
        )
    for part in parts:
        nodes = [(part.bus, letter) for letter in part.ends if letter]
        _join(graph, nodes[0], nodes[-1])
    fed = _reached(graph, [(source.bus, letter) for letter in "ABC"])
    left = [node for node in graph if node not in fed and node in held]
    while left:
        section = _reached(graph, [node for node in left if node[0] == left[0][0]])
        buses = list(dict.fromkeys(bus for bus, _ in left if (bus, _) in section))
        more = f" and {len(buses) - SHOWN} more" if len(buses) > SHOWN else ""
        at = sorted(_number(letter) for bus, letter in left if (bus, letter) in section and bus == buses[0])
        first = ", ".join(f"{buses[0]}.{number}" for number in at)
        problems.append(
            f"bus{'es' if len(buses) > 1 else ''} {', '.join(buses[:SHOWN])}{more} (first {first}): no path to the "
            "source, even with all switches closed; connect or leave out what is there"
        )
        left = [node for node in left if node not in section]


def report_undetermined(feeder: Feeder, problems: list[str]) -> None:
    """Add a problem for each bus whose voltage to ground nothing determines: without load it is beyond all bounds."""
    try:
        network = Network(feeder)
    except RuntimeError:  # of the factorisation
        problems.append(
            "nothing determines some bus's voltage to ground; ground a winding, or leave ppm_antifloat as it is"
        )
        return
    far = np.flatnonzero(np.abs(network.nominal) > BEYOND * network.V_nom)
    for bus in dict.fromkeys(network.nodes[i][0] for i in far):
        problems.append(
            f"bus {bus}: nothing determines its voltage to ground; ground a winding, or leave ppm_antifloat as it is"
        )


def _join(graph: dict[Node, set[Node]], one: Node, other: Node) -> None:
    graph.setdefault(one, set()).add(other)
    graph.setdefault(other, set()).add(one)


def _reached(graph: dict[Node, set[Node]], start: Iterable[Node]) -> set[Node]:
    found, ahead = set(start), list(start)
    while ahead:
        for node in graph.get(ahead.pop(), ()):
            if node not in found:
                found.add(node)
                ahead.append(node)
    return found


def _number(letter: str) -> int:
    return NODES.index(letter) + 1
