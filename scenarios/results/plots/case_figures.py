"""Curves of cases: f, MPSI, V_error and MQSI, which judge runs, on one page; each alone; two runs beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.results.history import Floats, History, Nameplates
from gridpeers.scenarios.results.island_membership import RowMeasure, worst
from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.plots.marks import BLACK, finish, mark_events
from gridpeers.scenarios.results.plots.style import (
    PAGE,
    SHARING,
    VOLTAGE,
    Bounds,
    Style,
    case_styles,
    from_zero,
    legend_below,
    name_panel,
    nominal_line,
    time_axis,
    words,
)
from gridpeers.scenarios.results.sharing_index import NO_LOAD


def _where_shared(index: Floats, x: Floats, history: History, nameplates: Nameplates) -> Floats:
    """Return an index where the total of x (W or var) is at least `NO_LOAD` of the ratings: below, it divides dust."""
    sharing = history.present & nameplates.shares
    total = np.abs(np.where(sharing, x, 0.0).sum(axis=1))
    rated = np.where(sharing, nameplates.s, 0.0).sum(axis=1)
    return np.where(total < NO_LOAD * rated, np.nan, index)


def _MPSI(history: History, nameplates: Nameplates) -> Floats:
    """Return the mean power sharing index of each row, (16); not a number without a load."""
    return _where_shared(metrics.MPSI(history, nameplates), history.P, history, nameplates)


def _MQSI(history: History, nameplates: Nameplates) -> Floats:
    """Return the mean var sharing index of each row, (17); not a number without vars."""
    return _where_shared(metrics.MQSI(history, nameplates), history.Q, history, nameplates)


class PlotMeasure(NamedTuple):
    """A measure over time as figures show it."""

    title: str
    label: str
    """Label of the axis, with the unit."""
    island_label: str
    """The same where the figure shows the worst of several islands."""
    of_row: RowMeasure
    nominal: float | None
    """Value from which islands depart; None: the nominal frequency."""
    bounds: Bounds | None = None
    """End of an axis that starts at 0; None: the axis has a line at the nominal value instead."""


MEASURES = {
    "frequency": PlotMeasure("Frequency", "mean of the GFM, f (Hz)", "f (Hz)", metrics.mean_frequency, None),
    "MPSI": PlotMeasure("Mean power sharing index, MPSI", "MPSI", "MPSI", _MPSI, 0.0, SHARING),
    "V_error": PlotMeasure(
        "Voltage error, V_error", "mean of abs(V - 1) (pu)", "V_error (pu)", metrics.V_error, 0.0, VOLTAGE
    ),
    "voltage": PlotMeasure("Mean voltage", "mean of all inverters, V (pu)", "mean V (pu)", metrics.mean_voltage, 1.0),
    "MQSI": PlotMeasure("Mean var sharing index, MQSI", "MQSI", "MQSI", _MQSI, 0.0, SHARING),
}
"""By the name of their figure. V_error judges the voltages: in the mean voltage, which the paper's figure shows,
terminals that are too high and too low cancel."""


def overview(drawing: Drawing) -> Figure:
    figure = Figure(figsize=(7.4, 4.6), layout="constrained")
    grid = figure.subplots(2, 2, sharex=True)
    for panel, name in zip(grid.flat, ("frequency", "MPSI", "V_error", "MQSI"), strict=True):
        draw_measure(panel, drawing, name)
    finish(grid, drawing)
    legend_below(figure, grid[0, 0])
    return figure


def single(drawing: Drawing, name: str) -> Figure:
    figure = Figure(figsize=(6.4, 3.2), layout="constrained")
    grid = figure.subplots(squeeze=False)
    draw_measure(grid[0, 0], drawing, name)
    finish(grid, drawing)
    legend_below(figure, grid[0, 0])
    return figure


def draw_measure(axes: Axes, drawing: Drawing, name: str) -> None:
    """Draw one of `MEASURES` over time, a curve for each case."""
    measure = MEASURES[name]
    drawn = {case: measured(drawing, case, name) for case in drawing.histories}
    curves(axes, drawing, drawn)
    label = f"{measure.island_label}, worst island" if drawing.island_intervals else measure.label
    name_panel(axes, measure.title, label)
    if measure.bounds is not None:
        from_zero(axes, [*drawn.values()], measure.bounds)
    else:
        nominal_line(axes, _nominal(drawing, measure))


def measured(drawing: Drawing, case: str, name: str) -> Floats:
    """Return one of `MEASURES` of a case, row by row; of the worst island while there are several."""
    measure, intervals = MEASURES[name], drawing.island_intervals.get(case, ())
    history, nameplates = drawing.histories[case], drawing.nameplates_in(case)
    return worst(measure.of_row, _nominal(drawing, measure), intervals, history, nameplates)


def _nominal(drawing: Drawing, measure: PlotMeasure) -> float:
    return drawing.f_nom if measure.nominal is None else measure.nominal


def curves(axes: Axes, drawing: Drawing, values: Mapping[str, Floats]) -> None:
    """Draw one curve per case, from its values by row; the later ones lie on top."""
    for (case, history), style in zip(drawing.histories.items(), case_styles(drawing.histories).values(), strict=True):
        colour, dashes, width = style
        label = words(drawing, case)
        axes.plot(history.t, values[case], color=colour, linestyle=dashes, linewidth=width, label=label)


WIDTH, HEIGHT = 7.4, 2.3  # Size of a figure, and of each row of panels in it (inches)
COLUMNS = 2  # Panels beside each other

_PANELS = (("frequency", "f (Hz)"), ("MPSI", "MPSI"), ("V_error", "mean of abs(V - 1) (pu)"), ("MQSI", "MQSI"))
"""Measures, and the labels of their axes."""

_STYLES: tuple[Style, Style] = (("#0072b2", "-", 2.2), ("#d55e00", (0, (4, 2)), 1.6))
"""Of the two: the second lies on top, dashed and thinner, so that equal ones are both seen."""


def comparison(pairs: Sequence[tuple[str, Mapping[str, Drawing]]]) -> Figure:
    """Draw two rows of panels for each pair of cases."""
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
