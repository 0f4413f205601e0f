"""Inverters whose available power falls: what they give, what the others give, and how far set-points go beyond it."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.results.drawing import Drawing
from scenarios.results.plots.cases import frequency
from scenarios.results.plots.marks import mark_events, note_above
from scenarios.results.plots.style import PAGE, case_styles, columns, time_axis

LOST = 0.3
"""Distance from nominal (Hz) at which a frequency that does not come back leaves the frame."""


def available_power(drawing: Drawing) -> Figure:
    """P of the first limited inverter and the mean of the others, f, and P_set - P of the limited one, by case."""
    first = drawing.limited[0]
    at = drawing.plates.names.index(first)
    others = np.array([name not in drawing.limited for name in drawing.plates.names])
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(7.4, 4.8), layout="constrained")
        grid = figure.subplots(2, 2, sharex=True)
        top, beside, below, last = grid.flat
        styles = case_styles(drawing.histories)
        for case, history in drawing.histories.items():
            colour, dashes, width = styles[case]
            share = history.P / drawing.plates.s
            ahead = history.P_set[:, at] / drawing.plates.s[at] - share[:, at]
            for panel, y in ((top, share[:, at]), (beside, share[:, others].mean(axis=1)), (last, ahead)):
                panel.plot(history.t, y, linestyle=dashes, color=colour, linewidth=width)
        beside.axhline(1.0, color="#000000", linewidth=0.6, zorder=1)
        frequency(below, drawing)
        _keep_in_view(below, drawing)
        texts = (
            (top, f"Power of {first}", "P (pu of rating)"),
            (beside, "Power of the inverters that are not limited", "their mean, P (pu of rating)"),
            (last, f"Set-point of {first} ahead of its power", "P_set - P (pu of rating)"),
        )
        for panel, title, label in texts:
            panel.set_title(title, loc="left")
            panel.set_ylabel(label)
            time_axis(panel, drawing)
        for panel in grid.flat:
            mark_events(panel, drawing, labelled=panel in (top, beside))
        for panel in grid[0]:
            panel.set_xlabel("")
        handles, labels = below.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=columns(labels, 7.4))
    return figure


def _keep_in_view(axes: Axes, drawing: Drawing) -> None:
    """Let a frequency that falls for good leave the frame instead of flattening all others."""
    ends = {case: float(history.f[-1, drawing.plates.GFM].mean()) for case, history in drawing.histories.items()}
    lost = [case for case, f in ends.items() if abs(f - drawing.f_nom) > LOST]
    if lost and len(lost) < len(ends):
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, drawing.f_nom - LOST), min(high, drawing.f_nom + LOST))
        for case in lost:
            note_above(axes, f"{case}: {ends[case]:.2f} Hz at the end", 1.0, "axes fraction", "right")
