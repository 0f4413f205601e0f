"""One-line map of a feeder with its microgrids, inverters and switches, from its tables. A figure for docs/concepts.md.

.venv/bin/python -m bench.feeder_map [--feeder FEEDER] [--figure docs/images/microgrid123.png]
"""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from bench.harness import options
from plant.equipment import Bus, Feeder, Switch
from plant.tables import read_feeder

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
"""Of the microgrids, in the order of the inverters, then of other zones (Okabe and Ito's palette)."""

BESIDE = "#8a8a8a"
"""The zone of the substation, and what has no zone."""

PHASES = {1: 0.7, 2: 1.1, 3: 2.0}
"""Width of a line (pt) by its number of phases."""

NEAR = 90.0
"""Distance (ft of the feeder's drawing) of a label from what it names."""

OFFSETS = {"60-160": (-430, 60), "67s-67": (60, -130), "97s-97": (70, -60), "54-94": (-260, 30), "13-152": (-120, 90)}
"""Where the label of a switch stands beside it (ft), where it would cover something."""

INVERTERS = {"inv3": (4, 5)}
"""The same of an inverter (pt)."""

HALO: Any = [withStroke(linewidth=2.0, foreground="white")]
"""Around labels, so that they can be read on lines."""


def colours_of(feeder: Feeder) -> dict[str, str]:
    """Return the colour of each zone."""
    zones = {bus.name: bus.zone for bus in feeder.buses}
    beside = {"", zones[feeder.source.bus] if feeder.source is not None else ""}
    first = [row.microgrid for row in feeder.inverters]
    named = [zone for zone in dict.fromkeys((*first, *zones.values())) if zone not in beside]
    return dict(zip(named, COLOURS, strict=False)) | dict.fromkeys(beside, BESIDE)


def load_of(feeder: Feeder, buses: set[str]) -> float:
    """Return the real load (W, at nominal voltage) at some buses."""
    return sum(phase.real for load in feeder.loads if load.bus in buses for phase in load.S)


def draw(feeder: Feeder, axes: Axes) -> None:
    """Draw a feeder."""
    at = {bus.name: bus for bus in feeder.buses}
    colours = colours_of(feeder)
    parts = [(line.from_bus, line.to_bus, line.phases) for line in feeder.lines]
    parts += [(row.from_bus, row.to_bus, "ABC") for row in feeder.transformers]
    parts += [(row.from_bus, row.to_bus, row.phases) for row in feeder.regulators]
    for a, b, phases in parts:
        colour, width = colours.get(at[b].zone, BESIDE), PHASES[len(phases)]
        axes.plot((at[a].x, at[b].x), (at[a].y, at[b].y), color=colour, lw=width, zorder=1, solid_capstyle="round")
    for loaded in dict.fromkeys(at[load.bus] for load in feeder.loads):
        axes.plot(loaded.x, loaded.y, ".", color=colours.get(loaded.zone, BESIDE), ms=3.5, zorder=2)
    for switch in feeder.switches:
        draw_switch(switch, at, axes)
    for row in (*feeder.inverters, *feeder.spares):
        bus, gfm = at[row.bus], row.kind == "GFM"
        face = "white" if row.spare else colours.get(row.microgrid, BESIDE)
        axes.plot(bus.x, bus.y, marker="s" if gfm else "o", ms=10 if gfm else 8, mfc=face, mec="black", zorder=4)
        text = f"{row.name}{' (spare)' if row.spare else ''}"
        beside = INVERTERS.get(row.name, (6, 6))
        axes.annotate(
            text, (bus.x, bus.y), beside, textcoords="offset points", weight="bold", zorder=5, path_effects=HALO
        )
    if feeder.source is not None:
        bus = at[feeder.source.bus]
        axes.plot(bus.x, bus.y, marker="D", ms=10, color="black", zorder=4)
        axes.annotate("substation", (bus.x, bus.y), (0, -16), textcoords="offset points", ha="center")


def draw_switch(switch: Switch, at: dict[str, Bus], axes: Axes) -> None:
    """Draw a switch: black when closed, white when open; its name if its sides stand apart or it has another one."""
    a, b = at[switch.from_bus], at[switch.to_bus]
    x, y = (a.x + b.x) / 2, (a.y + b.y) / 2
    axes.plot((a.x, b.x), (a.y, b.y), color="black", lw=1.0, ls="-" if switch.closed else ":", zorder=1)
    axes.plot(x, y, marker="s", ms=5, mfc="black" if switch.closed else "white", mec="black", zorder=3)
    dx, dy = OFFSETS.get(switch.name, (NEAR / 2, NEAR / 2))
    name = f"{switch.alias} ({switch.name})" if switch.alias else switch.name
    axes.text(x + dx, y + dy, name, size=7.5, color="#303030", zorder=5, path_effects=HALO)


def legend(feeder: Feeder, axes: Axes, picture: Figure) -> None:
    """Say what the marks are, and how much load each zone has."""
    for zone, colour in colours_of(feeder).items():
        buses = {bus.name for bus in feeder.buses if bus.zone == zone}
        rated = sum(row.P_rated for row in feeder.inverters if row.microgrid == zone)
        words = f"{zone}: {load_of(feeder, buses) / 1e3:.0f} kW of load"
        words += f", {rated / 1e3:.0f} kW of inverters" if rated else ""
        if buses:
            axes.plot([], [], color=colour, lw=3, label=words)
    for marker, face, words in (("s", BESIDE, "GFM inverter"), ("o", BESIDE, "GFL inverter"), ("o", "white", "spare")):
        axes.plot([], [], marker=marker, ms=8, mfc=face, mec="black", ls="", label=words)
    axes.plot([], [], marker="s", ms=5, mfc="black", mec="black", ls="", label="switch, closed")
    axes.plot([], [], marker="s", ms=5, mfc="white", mec="black", ls="", label="switch, open")
    picture.legend(loc="outside lower center", frameon=False, ncols=2)


def figure(feeder: Feeder) -> Figure:
    """Make the map."""
    picture = Figure(figsize=(10.5, 7.2), layout="constrained")
    axes = picture.add_subplot(aspect="equal")
    draw(feeder, axes)
    legend(feeder, axes, picture)
    axes.set_axis_off()
    return picture


def main() -> None:
    """Read the command line and write the figure."""
    given = options(__doc__, feeder="microgrid123", load_set="event2", figure="docs/images/microgrid123.png")
    figure(read_feeder(given.feeder, given.load_set)).savefig(given.figure, dpi=130)


if __name__ == "__main__":
    main()
