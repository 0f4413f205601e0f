"""A recorded run in faint lines, and the same run under changes in strong ones: f, P of every inverter, and MPSI."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.plots.run_figures import MEASURES, measured
from gridpeers.scenarios.results.plots.style import (
    PAGE,
    STYLES,
    from_zero,
    legend_below,
    mark_events,
    name_panel,
    nominal_line,
    time_axis,
)

LINES: tuple[tuple[dict[str, Any], float], ...] = (
    ({"linewidth": 2.6, "linestyle": "-"}, 0.65),
    ({"linewidth": 1.1, "linestyle": "-"}, 0.0),
)
"""Lines of the recorded run, below, and of the changed one, on top, each with the part of white in its colours. It is
no transparency: faint lines of several inverters on top of each other would be strong again."""

BLUE, GREEN, ORANGE = STYLES[0][0], STYLES[2][0], STYLES[1][0]


def counterfactual_figure(was: Drawing, would_be: Drawing, words: str, since: float) -> Figure:
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(7.4, 6.4), layout="constrained")
        top, middle, bottom = figure.subplots(3, 1, sharex=True)
        indices = []
        labels = "what was", f"what would have been: {words}"
        for drawing, label, (line, white) in zip((was, would_be), labels, LINES, strict=True):
            ((case, history),) = drawing.histories.items()
            blue, green = (_paler(colour, white) for colour in (BLUE, GREEN))
            top.plot(history.t, measured(drawing, case, "frequency"), color=blue, label=label, **line)
            for i in range(len(history.inverters)):
                colour = blue if drawing.nameplates.GFM[i] else green
                middle.plot(history.t, history.P[:, i] / drawing.nameplates.s[i], color=colour, **line)
            indices.append(measured(drawing, case, "MPSI"))
            bottom.plot(history.t, indices[-1], color=blue, **line)
        from_zero(bottom, indices, MEASURES["MPSI"].bounds)  # type: ignore[arg-type]  # this one has bounds
        nominal_line(top, was.f_nom)
        name_panel(top, "Frequency", "mean of the GFM, f (Hz)")
        name_panel(
            middle, "Real power of each inverter: grid-forming ones blue, grid-following ones green", "P (pu of rating)"
        )
        name_panel(bottom, "Mean power sharing index", "MPSI")
        for panel in (top, middle, bottom):
            time_axis(panel, was)
            mark_events(panel, would_be, labelled=panel is top)
            if since > 0.0:
                panel.axvline(since, color=ORANGE, linewidth=1.0, zorder=1)
            if panel is not bottom:
                panel.set_xlabel("")
        if since > 0.0:
            late = since > 0.7 * float(top.get_xlim()[1])
            top.annotate(
                "changed",
                (since, 0.04),
                xycoords=top.get_xaxis_transform(),
                xytext=(-4.0 if late else 4.0, 0.0),
                textcoords="offset points",
                ha="right" if late else "left",
                color=ORANGE,
                fontsize="small",
            )
        legend_below(figure, top)
    return figure


def _paler(colour: str, white: float) -> tuple[float, ...]:
    return tuple(white + (1.0 - white) * part for part in mpl.colors.to_rgb(colour))
