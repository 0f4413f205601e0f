"""Neutral conductors of a feeder: the nodes to which loads return, and what is connected to them in line."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from gridpeers.plant.equipment import PHASES, Bus, Switch, Tables
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart

EARTH = "earth"  # in place of a neutral: the inverter returns through earth, though its bus has a neutral
BETWEEN_PHASES = 1.3
"""Voltage of a load (pu of its bus, line-to-neutral) from which on it is between phases: there it is 1.73, or 2 between
the legs of a split-phase service."""

Node = tuple[str, str]


def neutrals_of(feeder: Tables) -> dict[str, str]:
    return neutrals_by_bus(feeder.buses, feeder.load_parts, feeder.elements, feeder.switches)


def neutral_for(text: str, bus: Bus, phases: str, neutral: str) -> str:
    """Return the letter of the node to which an inverter returns; empty for earth. ValueError says where it can.

    `text`: what is wanted: such a letter, `EARTH`, or empty for the bus's `neutral`, which is empty for none.
    """
    if text in ("", EARTH):
        return "" if text == EARTH or neutral in phases else neutral
    possible = [letter for letter in bus.phases if letter not in phases and (letter not in PHASES or letter == neutral)]
    if text not in possible:
        raise ValueError(
            f'neutral "{text}": bus "{bus.name}" has no such neutral; possible: {", ".join([*possible, EARTH])}'
        )
    return text


def neutrals_by_bus(
    buses: Iterable[Bus], load_parts: Iterable[LoadPart], elements: Iterable[LinearElement], switches: Iterable[Switch]
) -> dict[str, str]:
    """Return the neutral of each bus that has one: the letter of a node, that of most load where there are several.

    A neutral goes on along the elements that have it in the same place at both ends. Node A, B or C is none where loads
    return to earth: there a load between two phases has a voltage that is wrong.
    """
    load_parts = tuple(load_parts)
    V_nom = {bus.name: bus.V_nom for bus in buses}
    to_earth = {part.bus for part in load_parts if not part.ends[1]}
    weight: dict[Node, float] = {}
    for part in load_parts:
        if part.ends[1] and part.V_nom < BETWEEN_PHASES * V_nom[part.bus]:
            node = part.bus, next((end for end in part.ends if end not in PHASES), part.ends[1])
            weight[node] = weight.get(node, 0.0) + abs(part.S)
    along: dict[Node, list[Node]] = {}
    poles = (((it.from_bus, phase), (it.to_bus, phase)) for it in switches for phase in it.phases)
    for one, other in (*_conductors(elements), *poles):
        along.setdefault(one, []).append(other)
        along.setdefault(other, []).append(one)
    for seed in [node for node in weight if node[1] in PHASES]:
        if any(bus in to_earth for bus, _ in _connected([seed], along, V_nom)):
            del weight[seed]
    for node in _connected(weight, along, V_nom):
        weight.setdefault(node, 0.0)
    found: dict[str, str] = {}
    for (bus, letter), load in weight.items():
        if bus not in found or load > weight[bus, found[bus]]:
            found[bus] = letter
    return found


def _connected(nodes: Iterable[Node], along: Mapping[Node, list[Node]], V_nom: Mapping[str, float]) -> list[Node]:
    """Return these nodes and those that conductors connect with them, not through a transformer."""
    found = dict.fromkeys(nodes)
    waiting = list(found)
    while waiting:
        at = waiting.pop()
        for node in along.get(at, ()):
            if node not in found and 0.9 < V_nom[node[0]] / V_nom[at[0]] < 1.1:
                found[node] = None
                waiting.append(node)
    return list(found)


def _conductors(elements: Iterable[LinearElement]) -> Iterator[tuple[Node, Node]]:
    """Yield the two ends of each conductor of elements between two buses: same place in either half of the rows."""
    for element in elements:
        half = len(element.nodes) // 2
        ends = element.nodes[:half], element.nodes[half:]
        if len(ends[0]) == len(ends[1]) and all(len({bus for bus, _ in end}) == 1 for end in ends):
            yield from zip(*ends, strict=True)
