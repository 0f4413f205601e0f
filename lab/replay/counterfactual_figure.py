"""A recorded run in faint lines, and the same run under changes in strong ones: f, P of every inverter, and MPSI."""

from __future__ import annotations

from dataclasses import replace

import matplotlib as mpl
from matplotlib.figure import Figure

from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.plots.run_figures import MEASURES, P_LABEL, Page, Panel, PanelCurve, drawn, measured
from gridpeers.scenarios.results.plots.style import PAGE, STYLES

LINES = ((2.6, 0.65), (1.1, 0.0))
"""Widths (pt) of the lines of the recorded run, below, and of the changed one, on top, each with the part of white in
its colours. It is no transparency: faint lines of several inverters on top of each other would be strong again."""

BLUE, GREEN, ORANGE = STYLES[0][0], STYLES[2][0], STYLES[1][0]


def counterfactual_figure(was: Drawing, would_be: Drawing, words: str, since: float) -> Figure:
    nominal, bounds = was.f_nom, MEASURES["MPSI"].bounds
    f = Panel("Frequency", "mean of the GFM, f (Hz)", [], nominal)
    P = Panel("Real power of each inverter: grid-forming ones blue, grid-following ones green", P_LABEL, [])
    index = Panel("Mean power sharing index", "MPSI", [], bounds=bounds)
    labels = "what was", f"what would have been: {words}"
    for drawing, label, (width, white) in zip((was, would_be), labels, LINES, strict=True):
        ((case, history),) = drawing.histories.items()
        blue, green = ((_paler(colour, white), "-", width) for colour in (BLUE, GREEN))
        f.curves.append(PanelCurve(history.t, measured(drawing, case, "frequency"), blue, label))
        for power, GFM in zip((history.P / drawing.nameplates.s).T, drawing.nameplates.GFM, strict=True):
            P.curves.append(PanelCurve(history.t, power, blue if GFM else green))
        index.curves.append(PanelCurve(history.t, measured(drawing, case, "MPSI"), blue))
    with mpl.rc_context(PAGE):
        figure = drawn(Page([[f], [P], [index]], (7.4, 6.4)), replace(would_be, histories=was.histories))
        top = figure.axes[0]
        if since > 0.0:
            for panel in figure.axes:
                panel.axvline(since, color=ORANGE, linewidth=1.0, zorder=1)
            side = "right" if since > 0.7 * float(top.get_xlim()[1]) else "left"
            mark = top.text(since, 0.04, " changed ", color=ORANGE, fontsize="small", ha=side)
            mark.set_transform(top.get_xaxis_transform())
    return figure


def _paler(colour: str, white: float) -> str:
    red, green, blue = (white + (1.0 - white) * part for part in mpl.colors.to_rgb(colour))
    return mpl.colors.to_hex((red, green, blue))
