"""Time to share power over random communication graphs: the paper's figure of topologies."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from scenarios.results.claims.topology import TREE, medians
from scenarios.results.findings import GraphRun
from scenarios.results.plots.style import PAGE


def topologies(runs: Sequence[GraphRun]) -> Figure:
    """A point for each graph and the median of each number of links; below the tree, who never shares."""
    connected = tuple(run for run in runs if run.links >= TREE)
    times = medians(connected)
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(7.4, 3.2), layout="constrained")
        left, right = figure.subplots(1, 2)
        shared = [(run.links, run.settled.t_share_s) for run in connected if run.settled.t_share_s is not None]
        left.plot(*zip(*shared, strict=True), "o", color="#56b4e9", ms=4, alpha=0.8, label="a random connected graph")
        finite = {links: t for links, t in times.items() if np.isfinite(t)}
        left.plot(list(finite), list(finite.values()), "-", color="#0072b2", lw=2.0, label="median")
        left.axvspan(0, TREE - 0.5, color="#d55e00", alpha=0.12, lw=0)
        left.annotate(
            "not connected:\nno consensus",
            (0.4, 0.03),
            xycoords=("data", "axes fraction"),
            ha="left",
            va="bottom",
            fontsize=6,
            color="#444444",
        )
        left.set_xlim(0, 37)
        left.set_ylim(bottom=0.0)
        left.set_title("Time to share power after islanding", loc="left")
        left.set_ylabel("time until MPSI < 0.01 (s)")
        left.legend(loc="upper right")
        MPSI = [max(run.steady.MPSI, 1e-6) for run in runs]
        right.semilogy([run.links for run in runs], MPSI, "o", color="#56b4e9", ms=4, alpha=0.8)
        right.axhline(0.01, color="#000000", linewidth=0.6)
        right.annotate("0.01", (1.0, 0.01), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7)
        right.axvspan(left.get_xlim()[0], TREE - 0.5, color="#d55e00", alpha=0.12, lw=0)
        right.set_xlim(left.get_xlim())
        right.set_title("Power sharing at the end of the run", loc="left")
        right.set_ylabel("MPSI")
        for panel in (left, right):
            panel.set_xlabel("links of the communication graph (8: a tree, 36: all)")
    return figure
