"""What was, in faint lines, and what would have been, in strong ones: f, P of every inverter, and MPSI."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gridpeers.scenarios.results.history import Floats
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

FAINT: dict[str, Any] = {"linewidth": 2.6, "linestyle": "-"}
STRONG: dict[str, Any] = {"linewidth": 1.1, "linestyle": "-"}
"""Lines of what was, below, and of what would have been, on top: where they coincide, both are seen."""

PALE = 0.65
"""Part of white in the colour of a faint line. It is no transparency: lines of several inverters on top of each other
would be strong again."""

BLUE, GREEN = STYLES[0][0], STYLES[2][0]

KINDS = {True: BLUE, False: GREEN}
"""Colours of inverters: grid-forming, or not."""


def counterfactual_figure(was: Drawing, would_be: Drawing, words: str, since: float) -> Figure:
    """Draw two runs, each with one history of the same inverters."""
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(7.4, 6.4), layout="constrained")
        top, middle, bottom = figure.subplots(3, 1, sharex=True)
        both = ((was, FAINT, "what was"), (would_be, STRONG, f"what would have been: {words}"))
        for drawing, line, label in both:
            _plot(top, drawing, "frequency", line, label=label)
            _powers(middle, drawing, line)
        indices = []
        for drawing, line, _ in both:
            indices.append(_plot(bottom, drawing, "MPSI", line))
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
                panel.axvline(since, color="#d55e00", linewidth=1.0, zorder=1)
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
                color="#d55e00",
                fontsize="small",
            )
        legend_below(figure, top)
    return figure


def _plot(axes: Axes, drawing: Drawing, name: str, line: dict[str, Any], label: str | None = None) -> Floats:
    """Draw one of `MEASURES` of the drawing's history, and return it."""
    ((case, history),) = drawing.histories.items()
    values = measured(drawing, case, name)
    axes.plot(history.t, values, color=_shade(BLUE, line), label=label, **line)
    return values


def _powers(axes: Axes, drawing: Drawing, line: dict[str, Any]) -> None:
    ((_, history),) = drawing.histories.items()
    for i in range(len(history.inverters)):
        colour = _shade(KINDS[bool(drawing.nameplates.GFM[i])], line)
        axes.plot(history.t, history.P[:, i] / drawing.nameplates.s[i], color=colour, **line)


def _shade(colour: str, line: dict[str, Any]) -> tuple[float, float, float]:
    """Return the colour as a line of this kind has it."""
    red, green, blue = mpl.colors.to_rgb(colour)
    if line is STRONG:
        return red, green, blue
    return tuple(PALE + (1.0 - PALE) * part for part in (red, green, blue))  # type: ignore[return-value]  # of three
