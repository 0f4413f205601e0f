"""Two runs beside each other: the four measures of all cases, each run with its own inverters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gridpeers.scenarios.results.plots.case_figures import MEASURES, measured
from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.plots.marks import BLACK, mark_events
from gridpeers.scenarios.results.plots.style import PAGE, Style, from_zero, legend_below, name_panel, time_axis

WIDTH, HEIGHT = 7.4, 2.3
"""Size of a figure, and of each row of panels in it (inches)."""

COLUMNS = 2
"""Panels beside each other."""

_PANELS = (("frequency", "f (Hz)"), ("MPSI", "MPSI"), ("V_error", "mean of abs(V - 1) (pu)"), ("MQSI", "MQSI"))
"""Measures, and the labels of their axes."""

_STYLES: tuple[Style, Style] = (("#0072b2", "-", 2.2), ("#d55e00", (0, (4, 2)), 1.6))
"""Of the two: the second lies on top, dashed and thinner, so that equal ones are both seen."""


def comparison(pairs: Sequence[tuple[str, Mapping[str, Drawing]]]) -> Figure:
    """Draw two rows of panels for each pair of cases.

    Parameters
    ----------
    pairs : sequence of (str, Mapping[str, Drawing])
        Words on each pair, and for each of the two its name and a drawing with one history.
    """
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(WIDTH, 0.4 + 2 * HEIGHT * len(pairs)), layout="constrained")
        grid = figure.subplots(2 * len(pairs), COLUMNS, squeeze=False)
        for number, (words, drawings) in enumerate(pairs):
            panels = grid[2 * number : 2 * number + 2].flat
            for place, (panel, (name, label)) in enumerate(zip(panels, _PANELS, strict=True)):
                title = MEASURES[name].title
                name_panel(panel, f"{words}: {title}" if words else title, label)
                panel.ticklabel_format(axis="y", useOffset=False)
                _draw(panel, drawings, name, labelled=place < COLUMNS)
        legend_below(figure, grid[0, 0])
    return figure


def _draw(axes: Axes, drawings: Mapping[str, Drawing], measure: str, *, labelled: bool) -> None:
    """Draw one of `MEASURES` of both runs, and the events of both: those that one alone has in its colour."""
    drawn, colours = [], dict.fromkeys((mark for drawing in drawings.values() for mark in drawing.events), "")
    for (name, drawing), (colour, dashes, width) in zip(drawings.items(), _STYLES, strict=True):
        ((case, history),) = drawing.histories.items()
        drawn.append(measured(drawing, case, measure))
        axes.plot(history.t, drawn[-1], color=colour, linestyle=dashes, linewidth=width, label=name)
        colours |= {mark: BLACK if colours[mark] else colour for mark in dict.fromkeys(drawing.events)}
    if (bounds := MEASURES[measure].bounds) is not None:
        from_zero(axes, drawn, bounds)
    longer = max(drawings.values(), key=lambda drawing: max(history.t[-1] for history in drawing.histories.values()))
    time_axis(axes, longer)
    mark_events(axes, replace(longer, events=list(colours)), labelled=labelled, colours=colours)
