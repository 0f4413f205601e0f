"""The messages of a short time between the time axes of agents: lost ones end in a cross."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from gridpeers.lab.trace import Flow
from gridpeers.scenarios.results.plots.style import PAGE

SENT, LOST, REJECTED = "#0072b2", "#d55e00", "#cc79a7"

REACH = 0.6

WIDTH, ROW = 7.4, 0.38


def space_time_diagram(
    flows: Sequence[Flow], nodes: Sequence[str], since: float, until: float, usual: float, title: str
) -> Figure:
    place = {name: -i for i, name in enumerate(nodes)}
    shown = [flow for flow in flows if flow.src in place and flow.dst in place]
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(WIDTH, 1.1 + ROW * len(nodes)), layout="constrained")
        axes = figure.subplots()
        axes.hlines([place[name] for name in nodes], since, until, color="#000000", linewidth=0.8, zorder=1)
        for colour, label, chosen in (
            (SENT, "arrived", [flow for flow in shown if not flow.is_lost and not flow.fate]),
            (REJECTED, "arrived, rejected", [flow for flow in shown if not flow.is_lost and flow.fate]),
            (LOST, "lost", [flow for flow in shown if flow.is_lost]),
        ):
            if not chosen:
                continue
            ends = [_end(flow, place, usual) for flow in chosen]
            lines = [[(flow.sent, place[flow.src]), end] for flow, end in zip(chosen, ends, strict=True)]
            axes.add_collection(
                LineCollection(
                    lines, colors=colour, linewidths=0.7, alpha=0.8, label=f"{label} ({len(chosen)})", zorder=2
                )
            )
            marker, size = ("x", 22) if label == "lost" else (".", 8)
            t, y = zip(*ends, strict=True)
            axes.scatter(t, y, marker=marker, s=size, color=colour, linewidths=1.1, zorder=3)
        axes.set_yticks([place[name] for name in nodes], list(nodes))
        axes.set_xlim(since, until)
        axes.set_ylim(0.6 - len(nodes), 0.6)
        axes.set_xlabel("t (s)")
        axes.set_title(title)
        axes.spines[["left", "right", "top"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
        if shown:
            figure.legend(loc="outside lower right", ncols=3, frameon=False)
    return figure


def _end(flow: Flow, place: dict[str, int], usual: float) -> tuple[float, float]:
    if flow.arrived is not None:
        return flow.arrived, place[flow.dst]
    return flow.sent + REACH * usual, place[flow.src] + REACH * (place[flow.dst] - place[flow.src])
