"""Walks along a feeder: its buses one after the other, and what each branch cuts off."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from gridpeers.plant.equipment import Feeder


def neighbours(feeder: Feeder) -> dict[str, list[str]]:
    """Return the buses beside each bus, over branches and switches that are closed."""
    near: dict[str, list[str]] = {bus.name: [] for bus in feeder.buses}
    ties = [(switch.from_bus, switch.to_bus) for switch in feeder.switches if switch.closed]
    for one, other in [*((one, other) for one, other, _ in feeder.branches()), *ties]:
        near[one].append(other)
        near[other].append(one)
    return near


def depth_first(near: Mapping[str, Sequence[str]], roots: Iterable[str]) -> list[str]:
    """Return the buses that are reached, each branch to its end before the next one."""
    found: dict[str, None] = {}
    for root in roots:
        waiting = [root]
        while waiting:
            bus = waiting.pop()
            if bus not in found:
                found[bus] = None
                waiting += reversed(near[bus])
    return list(found)


def cut_off_sums(
    near: Mapping[str, Sequence[str]], root: str, what: Mapping[str, float]
) -> dict[tuple[str, str], float]:
    """Return what each branch, (nearer bus, farther bus), cuts off of a sum over buses; in a loop none does."""
    order = depth_first(near, [root])
    place = {bus: k for k, bus in enumerate(order)}
    above: dict[str, str] = {}
    for bus in order:  # in the order of a depth-first search the last neighbour before a bus is the one it came from
        before = [other for other in near[bus] if place[other] < place[bus]]
        if before:
            above[bus] = max(before, key=lambda other: place[other])
    lowest, weight = dict(place), {bus: what.get(bus, 0.0) for bus in order}
    cut: dict[tuple[str, str], float] = {}
    for bus in reversed(order):
        for other in near[bus]:
            if other != above.get(bus):
                lowest[bus] = min(lowest[bus], lowest[other] if above.get(other) == bus else place[other])
        if bus in above:
            if lowest[bus] >= place[bus]:
                cut[above[bus], bus] = weight[bus]
            weight[above[bus]] += weight[bus]
    return cut
