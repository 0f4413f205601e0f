"""The figure of no single run: time to share power over random graphs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import gridpeers as gp
from gridpeers.papers.singhal2022.communication_claims import TREE, GraphRun, medians

LEAST = 1e-6  # MPSI below this is drawn as this: on an axis of logarithms there is no 0

_CONNECTED: dict[str, Any] = {"marker": "o", "ms": 4, "color": "#56b4e9", "alpha": 0.8, "lw": 0}
_IN_PARTS: dict[str, Any] = {"marker": "x", "ms": 5, "mew": 1.4, "color": "#d55e00", "lw": 0}
"""Marks of the two kinds of graphs, in both panels."""


def topologies(runs: Sequence[GraphRun]) -> Figure:
    """A mark for each graph, another for those in parts, and the median of the connected ones by number of links."""
    connected = tuple(run for run in runs if run.connected)
    in_parts = tuple(run for run in runs if not run.connected)
    with mpl.rc_context(gp.figures.PAGE):
        figure = Figure(figsize=(7.4, 3.4), layout="constrained")
        left, right = figure.subplots(1, 2)
        for some, marks in ((connected, _CONNECTED), (in_parts, _IN_PARTS)):
            _times(left, some, marks)
            right.semilogy([run.links for run in some], [max(run.steady.MPSI, LEAST) for run in some], **marks)
        finite = {links: t for links, t in medians(connected).items() if np.isfinite(t)}
        (median,) = left.plot(list(finite), list(finite.values()), "-", color="#0072b2", lw=2.0)
        left.set_ylim(bottom=0.0, top=1.12 * left.get_ylim()[1])  # room below the edge for what never comes
        left.set_title("Time to share power after islanding", loc="left")
        left.set_ylabel("time until MPSI < 0.01 (s)")
        right.axhline(0.01, color="#000000", linewidth=0.6)
        right.annotate("0.01", (1.0, 0.01), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7)
        right.set_title("Power sharing at the end of the run", loc="left")
        right.set_ylabel("MPSI")
        for panel in (left, right):
            panel.axvspan(0, TREE - 0.5, color="#d55e00", alpha=0.10, lw=0)
            panel.set_xlim(0, 37)
            panel.set_xlabel("links of the communication graph (8: a tree, 36: all)")
        handles = [right.get_lines()[0], right.get_lines()[1], median]
        labels = ["a random connected graph", "a graph in parts", "median of the connected"]
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def _times(panel: Axes, runs: Sequence[GraphRun], marks: dict[str, Any]) -> None:
    """Times to share (s); a run that never shares has its mark at the upper edge."""
    came = [(run.links, run.settled.t_share_s) for run in runs if run.settled.t_share_s is not None]
    never = [run.links for run in runs if run.settled.t_share_s is None]
    panel.plot([links for links, _ in came], [t for _, t in came], **marks)
    panel.plot(never, [0.965] * len(never), transform=panel.get_xaxis_transform(), **marks)
    if never:
        panel.annotate("never", (0.005, 0.965), xycoords="axes fraction", va="center", fontsize=7, color="#444444")
