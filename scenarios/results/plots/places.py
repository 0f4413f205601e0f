"""Places on the one-line diagram of a feeder: of its buses by coordinates or as a tree, and of labels. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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


Points = NDArray[np.float64]

WIDTH, HEIGHT = 0.62, 1.2  # Width of a letter and height of a line, about, in sizes of the type

SIDES = ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
"""Sides of a mark on which its label can stand, to the right and upwards, the preferred one first."""

PREFERENCE = 0.05  # Length of covered line (pt) that is as bad as the next side
WORD, MARK = 20.0, 6.0  # Lengths (pt) as bad as a covered square point of another label, or of a mark


class PlacedLabel(NamedTuple):
    text: str
    size: float
    """Of its type (pt)."""
    place: tuple[float, float]
    """Of the mark (pt, or drawing units)."""
    gap: float
    """From the middle of its mark (pt)."""
    optional: bool = False
    """True if it is left out where it would cover anything."""
    bold: bool = False


def label_sides(labels: Sequence[PlacedLabel], lines: Points, marks: Points) -> list[tuple[int, int] | None]:
    """Return the side of its mark on which each label stands, one of `SIDES`; those that come first choose first.

    None stands for an optional label that has no room. `lines` has x and y of both ends, shape (n, 4); `marks`, also
    those of the labels, x, y and half of the width, shape (m, 3); all in pt.
    """
    words = np.empty((0, 4))
    boxes = np.column_stack([marks[:, :2] - marks[:, 2:], marks[:, :2] + marks[:, 2:]])
    chosen: list[tuple[int, int] | None] = []
    for label in labels:
        ways = [_box(label, side) for side in SIDES]
        covered = [_length_within(box, lines) + WORD * _common(box, words) + MARK * _common(box, boxes) for box in ways]
        best = int(np.argmin(np.array(covered) + PREFERENCE * np.arange(len(SIDES))))
        fits = not label.optional or covered[best] == 0.0
        chosen.append(SIDES[best] if fits else None)
        words = np.vstack([words, ways[best]]) if fits else words
    return chosen


def _box(label: PlacedLabel, side: tuple[int, int]) -> Points:
    """Return the left, lower, right and upper edge of a label (pt)."""
    width, height = WIDTH * label.size * len(label.text), HEIGHT * label.size
    gap = label.gap if 0 in side else 0.7 * label.gap
    x, y = (at + gap * way for at, way in zip(label.place, side, strict=True))
    left, low = x + (side[0] - 1) * width / 2.0, y + (side[1] - 1) * height / 2.0
    return np.array([left, low, left + width, low + height])


def _common(box: Points, others: Points) -> float:
    sides = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    return float(np.prod(np.maximum(sides, 0.0), axis=1).sum())


def _length_within(box: Points, lines: Points) -> float:
    """Return the length of lines within a box (Liang and Barsky's clipping)."""
    start, way = lines[:, :2], lines[:, 2:] - lines[:, :2]
    level = np.where(way == 0.0, 1e-12, way)
    one, other = (box[:2] - start) / level, (box[2:] - start) / level
    enter = np.maximum(np.minimum(one, other).max(axis=1), 0.0)
    leave = np.minimum(np.maximum(one, other).min(axis=1), 1.0)
    return float((np.maximum(leave - enter, 0.0) * np.hypot(*way.T)).sum())
