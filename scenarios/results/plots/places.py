"""Places of the buses on the one-line diagram of a feeder: by coordinates, or as a tree. Pure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gridpeers.plant.equipment import Tables

Places = Mapping[str, tuple[float, float]]  # Place of each bus (drawing units)


def places(feeder: Tables) -> dict[str, tuple[float, float]]:
    """Return where each bus is drawn: its coordinates, else beside a neighbour; a tree if the feeder has none."""
    if not has_coordinates(feeder):
        return _tree(feeder)
    known = {bus.name: (bus.x, bus.y) for bus in feeder.buses if (bus.x, bus.y) != (0.0, 0.0)}
    neighbours = _neighbours(feeder)
    waiting = list(known)
    for bus in waiting:  # it grows while buses without coordinates take those of a neighbour
        for other in neighbours[bus]:
            if other not in known:
                known[other] = known[bus]
                waiting.append(other)
    return {bus.name: known.get(bus.name, (bus.x, bus.y)) for bus in feeder.buses}


def has_coordinates(feeder: Tables) -> bool:
    """Return whether a feeder is drawn on its coordinates: more than a quarter of its buses stand apart."""
    return len({(bus.x, bus.y) for bus in feeder.buses}) > len(feeder.buses) // 4


def _neighbours(feeder: Tables) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {bus.name: [] for bus in feeder.buses}
    ends = [(a, b) for a, b, _ in feeder.branches()]
    for a, b in (*ends, *((switch.from_bus, switch.to_bus) for switch in feeder.switches)):
        found[a].append(b)
        found[b].append(a)
    return found


def _tree(feeder: Tables) -> dict[str, tuple[float, float]]:
    """Place each bus by its distance from the substation, and its branches side by side: none crosses another."""
    neighbours = _neighbours(feeder)
    first = feeder.source.bus if feeder.source else feeder.buses[0].name
    depth: dict[str, int] = {}
    children: dict[str, list[str]] = {bus: [] for bus in neighbours}
    order: list[str] = []
    for root in (first, *neighbours):  # a section that nothing connects has a root of its own
        if root in depth:
            continue
        depth[root] = 0
        reached = [root]
        for bus in reached:
            for other in neighbours[bus]:
                if other not in depth:
                    depth[other] = depth[bus] + 1
                    children[bus].append(other)
                    reached.append(other)
        waiting = [root]
        while waiting:
            order.append(waiting.pop())
            waiting += reversed(children[order[-1]])
    height: dict[str, float] = {}
    leaves = 0
    for bus in reversed(order):
        below = [height[child] for child in children[bus]]
        if not below:
            leaves += 1
        height[bus] = float(np.mean(below)) if below else float(leaves)
    return {bus: (float(depth[bus]), height[bus]) for bus in order}
