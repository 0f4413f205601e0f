"""One-line diagram of a feeder: its branches, switches, inverters and islands, or its voltages."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

from gridpeers.plant.equipment import Switch, Tables
from gridpeers.plant.equipment.connectivity import Connectivity
from gridpeers.scenarios.results.plots.places import Places, has_coordinates, places
from gridpeers.wire.wording import counted

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of the microgrids, in the order of the inverters, then of other zones (Okabe and Ito's palette)."""

BESIDE = "#8a8a8a"  # Colour of the zone of the substation, and of buses of no zone
WIDTH = {1: 0.7, 2: 1.1, 3: 2.0}  # Width of a branch (pt) by its number of phases
HALO: Any = [withStroke(linewidth=2.0, foreground="white")]  # Around labels, so that they can be read on branches
MANY = 400  # Buses beyond which loads are not marked and branches are half as wide
MOST_ZONES = 10  # Microgrids and other zones that the legend names
MARK = 12.0  # Width of a mark (pixels)
SIDES = ((1, 1), (1, -1), (-1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1))
"""Sides of a mark for its name, to the right and upwards, the preferred one first."""

MOST_LABELS = 15  # Inverters beyond which their names are left out, which would cover each other


def feeder_diagram(feeder: Tables, V: Mapping[str, float] | None = None) -> Figure:
    """Draw a feeder on its coordinates, or as a tree where it has none."""
    picture = Figure(figsize=(10.5, 7.2), layout="constrained")
    at, on_coordinates = places(feeder), has_coordinates(feeder)
    axes = picture.add_subplot(aspect="equal" if on_coordinates else "auto")
    few = len(feeder.buses) <= MANY
    zones = _zones(feeder)
    colours = _colours(feeder, zones)
    branches = list(feeder.branches())
    lines = LineCollection([(at[a], at[b]) for a, b, _ in branches], zorder=1, capstyle="round")
    lines.set_linewidth([(1.0 if few else 0.5) * WIDTH[phases] for *_, phases in branches])
    axes.add_collection(lines)
    axes.autoscale_view()
    if V is None:
        lines.set_color([colours.get(zones[a], BESIDE) for a, *_ in branches])
    else:
        lines.set_array(np.array([(V[a] + V[b]) / 2.0 for a, b, _ in branches]))
        lines.set(cmap="viridis", clim=(0.9, 1.1))
        picture.colorbar(lines, ax=axes, label="V (pu, lowest phase)", shrink=0.6)
    if few:
        for bus in feeder.load_by_bus():
            axes.plot(*at[bus], ".", color="black" if V else colours.get(zones[bus], BESIDE), ms=3.5, zorder=2)
    for switch in feeder.switches:
        x, y = zip(at[switch.from_bus], at[switch.to_bus], strict=True)
        axes.plot(x, y, color="black", lw=1.0, ls="-" if switch.closed else ":", zorder=1)
        face = "black" if switch.closed else "white"
        axes.plot(*_middle(switch, at), marker="s", ms=5, mfc=face, mec="black", zorder=3)
    for row in (*feeder.inverters, *feeder.spares):
        GFM = row.kind == "GFM"
        face = "white" if row.spare else BESIDE if V else colours.get(row.microgrid, BESIDE)
        axes.plot(*at[row.bus], marker="s" if GFM else "o", ms=10 if GFM else 8, mfc=face, mec="black", zorder=4)
    if feeder.source is not None:
        axes.plot(*at[feeder.source.bus], marker="D", ms=10, color="black", zorder=4)
    handles = _zone_handles(feeder, zones, colours) if V is None else []
    handles += _mark_handles(feeder, coloured=V is None, loads=few)
    picture.legend(handles=handles, loc="outside lower center", frameon=False, ncols=2)
    if not on_coordinates:
        picture.suptitle("The feeder has no coordinates: drawn as a tree, from the substation on the left", size=9)
    axes.set_axis_off()
    _write_names(feeder, at, axes)
    return picture


def _zones(feeder: Tables) -> dict[str, str]:
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


def _colours(feeder: Tables, zones: Mapping[str, str]) -> dict[str, str]:
    beside = {"", zones[feeder.source.bus] if feeder.source is not None else ""}
    first = [row.microgrid for row in feeder.inverters]
    named = [zone for zone in dict.fromkeys((*first, *zones.values())) if zone not in beside]
    return dict(zip(named, cycle(COLOURS), strict=False)) | dict.fromkeys(beside, BESIDE)


def _middle(switch: Switch, at: Places) -> tuple[float, float]:
    a, b = at[switch.from_bus], at[switch.to_bus]
    return (a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0


def _write_names(feeder: Tables, at: Places, axes: Axes) -> None:
    """Write the names of marks, each on the side on which it covers fewest marks and other names."""
    names: list[tuple[str, tuple[float, float], float]] = []
    if len(feeder.inverters) <= MOST_LABELS:
        inverters = (*feeder.inverters, *feeder.spares)
        names += [(f"{row.name}{' (spare)' * row.spare}", at[row.bus], 10.0) for row in inverters]
    if feeder.source is not None:
        names.append(("substation", at[feeder.source.bus], 10.0))
    if len(feeder.buses) <= MANY:
        names += [(one.alias or one.name, _middle(one, at), 7.5) for one in feeder.switches]
    axes.figure.draw_without_rendering()  # type: ignore[union-attr]  # lays the figure out; subfigures are not used
    centres = axes.transData.transform([place for _, place, _ in names]) if names else ()
    covered = [Bbox.from_bounds(x - MARK / 2.0, y - MARK / 2.0, MARK, MARK) for x, y in centres]
    for text, place, size in names:
        name = axes.annotate(text, place, (0, 0), textcoords="offset points", size=size, zorder=5, path_effects=HALO)
        boxes = [_box_beside(name, *side) for side in SIDES]
        best = min(range(len(SIDES)), key=lambda side: boxes[side].count_overlaps(covered))
        covered.append(_box_beside(name, *SIDES[best]))


def _box_beside(name: Annotation, right: int, up: int) -> Bbox:
    """Put a name beside its mark, and return the box that it covers then (pixels)."""
    name.set(ha=("center", "left", "right")[right], va=("center", "bottom", "top")[up])
    name.xyann = (6.0 * right, 5.0 * up)
    return name.get_window_extent()


def _zone_handles(feeder: Tables, zones: Mapping[str, str], colours: Mapping[str, str]) -> list[Line2D]:
    """Return the lines of the legend that say what the colours are: microgrids and other zones, and what they have."""
    load = dict.fromkeys(zones.values(), 0.0)
    for bus, P in feeder.load_by_bus().items():
        load[zones[bus]] += P / 1e3
    handles = []
    for zone, colour in colours.items():
        rated = sum(row.P_rated for row in feeder.inverters if row.microgrid == zone) / 1e3
        content = [f"{load[zone]:.0f} kW of load"] if zone in load else []
        content += [f"{rated:.0f} kW of inverters"] if rated else []
        if content:
            text = f"{zone or 'no microgrid'}: {', '.join(content)}"
            handles.append(Line2D([], [], color=colour, lw=3, label=text))
    if len(handles) > MOST_ZONES:
        rest = counted(len(handles) - MOST_ZONES, "more zone")
        handles = [*handles[:MOST_ZONES], Line2D([], [], ls="", label=f"and {rest}; the colours repeat")]
    return handles


def _mark_handles(feeder: Tables, *, coloured: bool, loads: bool) -> list[Line2D]:
    kinds, states = {row.kind for row in feeder.inverters}, {switch.closed for switch in feeder.switches}
    of = ", in its microgrid's colour" if coloured else ""
    marks = (
        ("s", 8, BESIDE, "", f"GFM inverter{of}", "GFM" in kinds),
        ("o", 8, BESIDE, "", f"GFL inverter{of}", "GFL" in kinds),
        ("o", 8, "white", "", "spare inverter", bool(feeder.spares)),
        ("s", 5, "black", "-", "closed switch: black", True in states),
        ("s", 5, "white", ":", "open switch: white", False in states),
        ("o", 2, "black", "", "bus with load", loads and bool(feeder.load_by_bus())),
    )
    return [
        Line2D([], [], marker=marker, ms=size, mfc=face, mec="black", color="black", ls=line, lw=1.0, label=text)
        for marker, size, face, line, text, shown in marks
        if shown
    ]
