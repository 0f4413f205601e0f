"""One-line diagram of a feeder: its branches, switches, inverters and islands, or its voltages."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from plant.equipment import Feeder, Switch
from plant.equipment.connectivity import Connectivity

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of the microgrids, in the order of the inverters, then of other zones (Okabe and Ito's palette)."""

BESIDE = "#8a8a8a"
"""The zone of the substation, and buses of no zone."""

WIDTH = {1: 0.7, 2: 1.1, 3: 2.0}
"""Width of a branch (pt) by its number of phases."""

HALO: Any = [withStroke(linewidth=2.0, foreground="white")]
"""Around labels, so that they can be read on branches."""

MANY = 400
"""Buses beyond which loads are not marked and branches are half as wide."""

MOST_LABELS = 15
"""Inverters beyond which their names are left out, which would cover each other."""

Places = Mapping[str, tuple[float, float]]


def feeder_diagram(feeder: Feeder, V: Mapping[str, float] | None = None) -> Figure:
    """Draw a feeder on its coordinates, or as a tree where it has none.

    Parameters
    ----------
    feeder : Feeder
        Its tables.
    V : Mapping[str, float], optional
        Voltage (pu) of each bus, by which branches are coloured; else they have their zone's colour.
    """
    picture = Figure(figsize=(10.5, 7.2), layout="constrained")
    at = places(feeder)
    axes = picture.add_subplot(aspect="equal" if _has_coordinates(feeder) else "auto")
    few = len(feeder.buses) <= MANY
    zones = _zones(feeder)
    colours = _colours(feeder, zones)
    lines = _draw_branches(feeder, at, axes)
    if V is None:
        lines.set_color([colours.get(zones[a], BESIDE) for a, _, _ in feeder.branches()])
    else:
        lines.set_array(np.array([(V[a] + V[b]) / 2.0 for a, b, _ in feeder.branches()]))
        lines.set(cmap="viridis", clim=(0.9, 1.1))
        picture.colorbar(lines, ax=axes, label="V (pu, lowest phase)", shrink=0.6)
    if few:
        for bus in feeder.load_by_bus():
            axes.plot(*at[bus], ".", color="black" if V else colours.get(zones[bus], BESIDE), ms=3.5, zorder=2)
    for switch in feeder.switches:
        _draw_switch(switch, at, axes, named=few)
    labelled = len(feeder.inverters) <= MOST_LABELS
    for row in (*feeder.inverters, *feeder.spares):
        GFM = row.kind == "GFM"
        face = "white" if row.spare else colours.get(row.microgrid, BESIDE)
        axes.plot(*at[row.bus], marker="s" if GFM else "o", ms=10 if GFM else 8, mfc=face, mec="black", zorder=4)
        if not labelled:
            continue
        text = f"{row.name}{' (spare)' if row.spare else ''}"
        axes.annotate(text, at[row.bus], (6, 6), textcoords="offset points", weight="bold", zorder=5, path_effects=HALO)
    if feeder.source is not None:
        axes.plot(*at[feeder.source.bus], marker="D", ms=10, color="black", zorder=4)
        axes.annotate("substation", at[feeder.source.bus], (0, -16), textcoords="offset points", ha="center")
    _legend(feeder, zones, colours if V is None else {}, axes, picture)
    axes.set_axis_off()
    return picture


def places(feeder: Feeder) -> dict[str, tuple[float, float]]:
    """Return where each bus is drawn: its coordinates, else beside a neighbour; a tree if the feeder has none."""
    if not _has_coordinates(feeder):
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


def _has_coordinates(feeder: Feeder) -> bool:
    return len({(bus.x, bus.y) for bus in feeder.buses}) > len(feeder.buses) // 4


def _neighbours(feeder: Feeder) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {bus.name: [] for bus in feeder.buses}
    ends = [(a, b) for a, b, _ in feeder.branches()]
    for a, b in (*ends, *((switch.from_bus, switch.to_bus) for switch in feeder.switches)):
        found[a].append(b)
        found[b].append(a)
    return found


def _tree(feeder: Feeder) -> dict[str, tuple[float, float]]:
    """Place each bus by its distance from the substation, and among its like by its first leaf."""
    neighbours = _neighbours(feeder)
    root = feeder.source.bus if feeder.source else feeder.buses[0].name
    children: dict[str, list[str]] = {bus: [] for bus in neighbours}
    depth, order = {root: 0}, [root]
    rest = iter(list(neighbours))
    while len(order) < len(neighbours):
        for bus in order:
            for other in neighbours[bus]:
                if other not in depth:
                    depth[other] = depth[bus] + 1
                    children[bus].append(other)
                    order.append(other)
        if len(order) < len(neighbours):  # a section that nothing connects
            other = next(bus for bus in rest if bus not in depth)
            depth[other] = 0
            order.append(other)
    height: dict[str, float] = {}
    leaves = 0
    for bus in reversed(order):
        below = [height[child] for child in children[bus]]
        if not below:
            leaves += 1
        height[bus] = float(np.mean(below)) if below else float(leaves)
    return {bus: (float(depth[bus]), height[bus]) for bus in order}


def _zones(feeder: Feeder) -> dict[str, str]:
    """Return the zone of each bus: as its table says, else the microgrid whose inverters its section has."""
    if any(bus.zone for bus in feeder.buses):
        return {bus.name: bus.zone for bus in feeder.buses}
    found = {bus.name: "" for bus in feeder.buses}
    for part in Connectivity(feeder).parts(closed=()):
        buses = {bus for bus, _ in part}
        if feeder.source and feeder.source.bus in buses:
            continue
        microgrid = next((row.microgrid for row in feeder.inverters if row.bus in buses), "")
        found.update(dict.fromkeys(buses, microgrid))
    return found


def _colours(feeder: Feeder, zones: Mapping[str, str]) -> dict[str, str]:
    """Return the colour of each zone."""
    beside = {"", zones[feeder.source.bus] if feeder.source is not None else ""}
    first = [row.microgrid for row in feeder.inverters]
    named = [zone for zone in dict.fromkeys((*first, *zones.values())) if zone not in beside]
    return dict(zip(named, cycle(COLOURS), strict=False)) | dict.fromkeys(beside, BESIDE)


def _draw_branches(feeder: Feeder, at: Places, axes: Axes) -> LineCollection:
    thin = 0.5 if len(feeder.buses) > MANY else 1.0
    rows = list(feeder.branches())
    lines = LineCollection([(at[a], at[b]) for a, b, _ in rows], zorder=1, capstyle="round")
    lines.set_linewidth([thin * WIDTH[phases] for _, _, phases in rows])
    axes.add_collection(lines)
    axes.autoscale_view()
    return lines


def _draw_switch(switch: Switch, at: Places, axes: Axes, *, named: bool) -> None:
    """Draw a switch: black when closed, white when open; its name if its sides stand apart or it has another one."""
    a, b = at[switch.from_bus], at[switch.to_bus]
    middle = (a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0
    axes.plot((a[0], b[0]), (a[1], b[1]), color="black", lw=1.0, ls="-" if switch.closed else ":", zorder=1)
    axes.plot(*middle, marker="s", ms=5, mfc="black" if switch.closed else "white", mec="black", zorder=3)
    if named:
        text = switch.alias or switch.name
        axes.annotate(text, middle, (5, -9), textcoords="offset points", size=7.5, zorder=5, path_effects=HALO)


def _legend(feeder: Feeder, zones: Mapping[str, str], colours: Mapping[str, str], axes: Axes, picture: Figure) -> None:
    """Say what the marks are, and how much load each zone has."""
    load = dict.fromkeys(zones.values(), 0.0)
    for bus, P in feeder.load_by_bus().items():
        load[zones[bus]] += P / 1e3
    for zone, colour in colours.items():
        rated = sum(row.P_rated for row in feeder.inverters if row.microgrid == zone) / 1e3
        text = f"{zone or 'no zone'}: {load.get(zone, 0.0):.0f} kW of load" + (
            f", {rated:.0f} kW of inverters" if rated else ""
        )
        if zone in load:
            axes.plot([], [], color=colour, lw=3, label=text)
    kinds, states = {row.kind for row in feeder.inverters}, {switch.closed for switch in feeder.switches}
    marks = (
        ("s", 8, BESIDE, "GFM inverter", "GFM" in kinds),
        ("o", 8, BESIDE, "GFL inverter", "GFL" in kinds),
        ("o", 8, "white", "spare", bool(feeder.spares)),
        ("s", 5, "black", "switch, closed", True in states),
        ("s", 5, "white", "switch, open", False in states),
    )
    for marker, size, face, text, shown in marks:
        if shown:
            axes.plot([], [], marker=marker, ms=size, mfc=face, mec="black", ls="", label=text)
    picture.legend(loc="outside lower center", frameon=False, ncols=2)
