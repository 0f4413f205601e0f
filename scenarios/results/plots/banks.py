"""MQSI of the paper and of ours with capacitors at other buses, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from scenarios.results.plots.style import PAGE

_COLOURS = ("#000000", "#0072b2", "#56b4e9", "#009e73", "#e69f00")
_HATCHES = ("", "", "//", "..", "xx")

Bars = Mapping[str, Mapping[tuple[str, str], float]]
"""MQSI of each variant, by case and event."""


def var_sharing(bars: Bars, cases: Sequence[str], events: Sequence[str]) -> Figure:
    """One group of bars for each case, one panel for each event; the first variant is the paper."""
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(7.4, 3.4), layout="constrained")
        panels = figure.subplots(1, len(events), sharey=True)
        x, width = np.arange(len(cases)), 0.8 / len(bars)
        for panel, event in zip(panels, events, strict=True):
            for number, (variant, values) in enumerate(bars.items()):
                heights = [values[case, event] for case in cases]
                at = x + (number - 0.5 * (len(bars) - 1)) * width
                panel.bar(
                    at,
                    heights,
                    width,
                    label=variant,
                    color=_COLOURS[number % 5],
                    hatch=_HATCHES[number % 5],
                    edgecolor="#ffffff",
                    linewidth=0.4,
                )
            panel.set_xticks(x, [f"case {case}" for case in cases])
            panel.set_title(f"Var sharing after {event}", loc="left")
            panel.grid(visible=False, axis="x")
        panels[0].set_ylabel("MQSI")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure
