"""The figures of the page: cost against the number of agents and of messages, from the measurements alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from bench.peers.measured import PartRun
from bench.peers.our_scale import links
from bench.peers.stored import Parts
from gridpeers.figures import PAGE, save

FOLDER = "images/performance"

COLOURS = {"ours": "#0072b2", "zenoh": "#7a7a7a", "zeromq": "#009e73", "full": "#0072b2", "ring": "#d55e00"}
NAMES = {"ours": "gridpeers", "zenoh": "bare Zenoh", "zeromq": "ZeroMQ ipc"}

MARKER: dict[str, Any] = {"marker": "o", "markersize": 3}


def draw_figures(parts: Parts, folder: Path) -> None:
    """Write the figures of the parts that are measured into a folder."""
    for name, (title, draw) in FIGURES.items():
        if drawn(parts, name):
            with mpl.rc_context(PAGE):
                figure = draw(parts[name])
                figure.suptitle(title, fontsize=10)
                save(figure, folder / FOLDER, name, formats=("svg",))


def drawn(parts: Parts, name: str) -> bool:
    """Return whether there is a figure of a part."""
    return name in FIGURES and name in parts and bool(parts[name].values)


def link(name: str) -> str:
    """Return a figure of the page, with its title."""
    return f"![{FIGURES[name][0]}]({FOLDER}/{name}.svg)"


def _sizes(part: PartRun, prefix: str, suffix: str = "") -> tuple[list[int], list[float]]:
    """Return numbers of agents, and medians, of the values with a prefix."""
    found = {
        int(name.removeprefix(prefix).removesuffix(suffix)): part.median(name)
        for name in part.values
        if name.startswith(prefix)
        and name.endswith(suffix)
        and name.removeprefix(prefix).removesuffix(suffix).isdigit()
    }
    return sorted(found), [found[n] for n in sorted(found)]


def _axes() -> tuple[Figure, Any, Any]:
    figure = Figure(figsize=(8.4, 3.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    return figure, left, right


def _sized(axes: Any, *sizes: int) -> None:
    """Mark the numbers of agents that were measured on the axis."""
    axes.set_xticks(sizes, [f"{size}" for size in sizes])
    axes.set_xticks([], minor=True)


def _agents(part: PartRun) -> Figure:
    figure, left, right = _axes()
    for who, name in NAMES.items():
        for graph, dash in (("full", "-"), ("ring", "--")):
            n, seconds = _sizes(part, f"{who}.{graph}.")
            if not n:
                continue
            style = {"color": COLOURS[who], "linestyle": dash, "label": f"{name}, {graph}", **MARKER}
            left.plot(n, [1e3 * each for each in seconds], **style)
            right.plot([links(graph, k) for k in n], [1e3 * each for each in seconds], **style)
    left.set(title="Against agents", xlabel="agents, a process each", ylabel="time of a tick (ms)", yscale="log")
    right.set(title="Against messages", xlabel="messages in a tick", ylabel="time of a tick (ms)")
    right.set(xscale="log", yscale="log")
    _sized(left, *(_sizes(part, "ours.full.")[0]))
    left.legend(fontsize=7)
    return figure


def _links(part: PartRun) -> Figure:
    figure, left, right = _axes()
    for graph in ("ring", "full"):
        style = {"color": COLOURS[graph], "label": graph, **MARKER}
        n, seconds = _sizes(part, f"inprocess.link.{graph}.")
        left.plot(n, [1e6 * each for each in seconds], **style)
        n, seconds = _sizes(part, f"inprocess.tick.{graph}.")
        right.plot([links(graph, k) for k in n], [1e3 * each for each in seconds], **style)
    left.set(title="A message, without the plant", xlabel="agents in one process", xscale="log")
    left.set(ylabel="processor time (µs)", ylim=(0, None))
    _sized(left, *(_sizes(part, "inprocess.link.ring.")[0]))
    right.set(title="A tick, with the plant", xlabel="messages in a tick", xscale="log")
    right.set(ylabel="processor time (ms)", yscale="log")
    left.legend(fontsize=8)
    return figure


def _scale(part: PartRun) -> Figure:
    figure, left, right = _axes()
    for name, text, colour in (
        ("by_the_clock", "together, by the clock", "#000000"),
        ("plant_per_s", "plant", COLOURS["zeromq"]),
        ("agents_per_s", "agents", COLOURS["ring"]),
    ):
        n, seconds = _sizes(part, "scale.100.", f".{name}")
        left.plot(n, seconds, color=colour, label=text, **MARKER)
    n, us = _sizes(part, "scale.100.", ".us_per_message")
    right.plot(n, us, color=COLOURS["ring"], **MARKER)
    left.axhline(1.0, color="#7a7a7a", lw=0.8)
    left.annotate("real time", (9, 1.0), va="bottom", fontsize=7)
    left.set(title="A simulated second", xlabel="agents in one process", xscale="log", yscale="log")
    left.set(ylabel="time (s)")
    right.set(title="A message, without the plant", xlabel="agents in one process", xscale="log")
    right.set(ylabel="processor time (µs)", ylim=(0, None))
    for axes in (left, right):
        _sized(axes, *n)
    left.legend(fontsize=7)
    return figure


FIGURES = {
    "agents": ("Cost of a tick against the number of agents and of messages, a process each, T_c 20 ms", _agents),
    "links": ("Cost of a message, and of a tick, in one process, T_c 20 ms", _links),
    "scale": ("Cost of a simulated second, and of a message, against the number of agents, ring, T_c 100 ms", _scale),
}
"""Title, and function that draws, by part."""
