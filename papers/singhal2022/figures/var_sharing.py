"""MQSI of the paper and of ours with capacitors at other buses, side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from gridpeers.figures import PAGE
from gridpeers.papers.singhal2022.tolerances import MQSI_FACTOR

_COLOURS = ("#0072b2", "#56b4e9", "#009e73", "#e69f00")
_MARKERS = "os^D"

EventValues = Mapping[tuple[str, str], float]
"""MQSI by case and event."""


def var_sharing(
    paper: EventValues, ours: Mapping[str, EventValues], cases: Sequence[str], events: Sequence[str]
) -> Figure:
    """Draw a mark for each variant of ours beside the paper's line, one panel for each event.

    The axis is one of logarithms, as MQSI is 100 times smaller in case IV than in case II; marks stand on it instead of
    bars, which would have no foot there.
    """
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(7.4, 3.6), layout="constrained")
        (panels,) = figure.subplots(1, len(events), sharey=True, squeeze=False)
        for panel, event in zip(panels, events, strict=True):
            for x, case in enumerate(cases):
                number = paper[case, event]
                ends = np.array([number / MQSI_FACTOR.value, number * MQSI_FACTOR.value])
                panel.fill_between([x - 0.42, x + 0.42], *ends, color="#000000", alpha=0.10, lw=0)
                panel.hlines(number, x - 0.42, x + 0.42, color="#000000", lw=1.6)
            for number, (variant, values) in enumerate(ours.items()):
                at = np.arange(len(cases)) + (number - 0.5 * (len(ours) - 1)) * 0.18
                heights = [values[case, event] for case in cases]
                marks = {"marker": _MARKERS[number % 4], "color": _COLOURS[number % 4]}
                panel.plot(at, heights, lw=0, ms=6, mec="#ffffff", mew=0.5, label=variant, **marks)
            panel.set_yscale("log")
            panel.set_xticks(range(len(cases)), [f"case {case}" for case in cases])
            panel.set_title(f"Var sharing after {event}", loc="left")
            panel.yaxis.set_major_formatter("{x:g}")
            panel.grid(visible=False, axis="x")
        panels[0].set_ylabel("MQSI")
        handles, labels = panels[0].get_legend_handles_labels()
        band = panels[0].collections[0]
        line = panels[0].collections[1]
        handles, labels = [line, band, *handles], ["the paper", f"a factor of {MQSI_FACTOR.value:g} of it", *labels]
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure
