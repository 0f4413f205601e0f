"""Nodes of a circuit whose voltage nothing determines: in a section without the source, or without a path to ground."""

from __future__ import annotations

import numpy as np

from plant.connectivity import Connectivity, by_bus
from plant.equipment import NODES, Feeder
from plant.network import Network

BEYOND = 100.0
"""Voltage without load (pu) that only a singular matrix gives."""

SHOWN = 5
"""How many buses of a floating section a problem names."""


def report_unconnected(feeder: Feeder, problems: list[str]) -> None:
    """Add a problem for each node that loads alone lead to, and each section without the source, switches closed."""
    assert feeder.source is not None
    held = {node for row in feeder.elements for node, values in zip(row.nodes, row.Y, strict=True) if any(values)}
    alone: dict[tuple[str, str], dict[int, None]] = {}
    for part in feeder.load_parts:
        for letter in part.ends:
            if letter and (part.bus, letter) not in held:
                alone.setdefault((part.name, part.bus), {})[_number(letter)] = None
    for (name, bus), numbers in alone.items():
        problems.append(
            f"{name}: node {', '.join(map(str, sorted(numbers)))} of bus {bus} is connected to nothing but loads: a "
            "phase that does not come there, or an open neutral; connect or ground it"
        )
    graph = Connectivity(feeder)
    through_loads = [
        ((part.bus, one), (part.bus, other)) for part in feeder.load_parts for one, other in [part.ends] if other
    ]
    source = feeder.source.bus
    parts = graph.parts(whole=[source], tied=through_loads)
    for section in by_bus(part for part in parts if (source, "A") not in part and part & held):
        nodes = [node for node in graph.nodes if node in section & held]
        buses = list(dict.fromkeys(bus for bus, _ in nodes))
        more = f" and {len(buses) - SHOWN} more" if len(buses) > SHOWN else ""
        first = ", ".join(f"{bus}.{_number(letter)}" for bus, letter in nodes if bus == buses[0])
        problems.append(
            f"bus{'es' if len(buses) > 1 else ''} {', '.join(buses[:SHOWN])}{more} (first {first}): no path to the "
            "source, even with all switches closed; connect or leave out what is there"
        )


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


def _number(letter: str) -> int:
    return NODES.index(letter) + 1
