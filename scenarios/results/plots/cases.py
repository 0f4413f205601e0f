"""Curves of all cases: f, MPSI, V_error and MQSI, which judge runs, on one page; and each alone, and mean V."""

from __future__ import annotations

from collections.abc import Callable

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.results import metrics
from scenarios.results.drawing import Drawing
from scenarios.results.history import Floats
from scenarios.results.island_membership import Quantity, worst
from scenarios.results.plots import sharing
from scenarios.results.plots.marks import mark_events
from scenarios.results.plots.style import PAGE, SHARING, VOLTAGE, case_styles, columns, from_zero, time_axis, words


def overview(drawing: Drawing) -> Figure:
    """All four measures of all cases on one page."""
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(7.4, 4.6), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True)
        for panel, draw in zip(axes.flat, (frequency, MPSI, V_error, MQSI), strict=True):
            draw(panel, drawing)
            mark_events(panel, drawing, labelled=draw in (frequency, MPSI))
        for panel in axes[0]:
            panel.set_xlabel("")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=columns(labels, 7.4))
    return figure


def single(drawing: Drawing, draw: Callable[[Axes, Drawing], None]) -> Figure:
    """One quantity of all cases on a page of its own."""
    figure = Figure(figsize=(6.4, 3.2), layout="constrained")
    axes = figure.subplots()
    draw(axes, drawing)
    mark_events(axes, drawing, labelled=True)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns(labels, 6.4))
    return figure


def frequency(axes: Axes, drawing: Drawing) -> None:
    """Frequency over time."""
    curves(axes, drawing, worst(metrics.mean_frequency, drawing.f_nom, drawing.spells))
    axes.axhline(drawing.f_nom, color="#000000", linewidth=0.6, zorder=1)
    axes.set_title("Frequency", loc="left")
    axes.set_ylabel(_of(drawing, "mean of the GFM, f (Hz)", "f (Hz)"))
    axes.ticklabel_format(axis="y", useOffset=False)


def MPSI(axes: Axes, drawing: Drawing) -> None:
    """Mean power sharing index over time, (16)."""
    quantity = worst(sharing.MPSI, 0.0, drawing.spells)
    drawn = curves(axes, drawing, quantity)
    axes.set_title("Mean power sharing index, MPSI", loc="left")
    axes.set_ylabel(_of(drawing, "MPSI", "MPSI"))
    from_zero(axes, drawn, SHARING)


def V_error(axes: Axes, drawing: Drawing) -> None:
    """Mean of abs(V - 1) over time: what the voltages are judged by."""
    quantity = worst(metrics.V_error, 0.0, drawing.spells)
    drawn = curves(axes, drawing, quantity)
    axes.set_title("Voltage error, V_error", loc="left")
    axes.set_ylabel(_of(drawing, "mean of abs(V - 1) (pu)", "V_error (pu)"))
    from_zero(axes, drawn, VOLTAGE)


def voltage(axes: Axes, drawing: Drawing) -> None:
    """Mean voltage over time, as in the paper's figure; terminals that are too high and too low cancel in it."""
    curves(axes, drawing, worst(metrics.mean_voltage, 1.0, drawing.spells))
    axes.axhline(1.0, color="#000000", linewidth=0.6, zorder=1)
    axes.set_title("Mean voltage", loc="left")
    axes.set_ylabel(_of(drawing, "mean of all inverters, V (pu)", "mean V (pu)"))
    axes.ticklabel_format(axis="y", useOffset=False)


def MQSI(axes: Axes, drawing: Drawing) -> None:
    """Mean var sharing index over time, (17)."""
    quantity = worst(sharing.MQSI, 0.0, drawing.spells)
    drawn = curves(axes, drawing, quantity)
    axes.set_title("Mean var sharing index, MQSI", loc="left")
    axes.set_ylabel(_of(drawing, "MQSI", "MQSI"))
    from_zero(axes, drawn, SHARING)


def _of(drawing: Drawing, whole: str, each: str) -> str:
    """Label of an axis: of the whole, or of the worst island where there come to be several."""
    return f"{each}, worst island" if drawing.spells else whole


def curves(axes: Axes, drawing: Drawing, quantity: Quantity) -> list[Floats]:
    """One curve per case; the later ones lie on top."""
    styles, drawn = case_styles(drawing.histories), []
    for case, history in drawing.histories.items():
        colour, dashes, width = styles[case]
        label = words(drawing, case)
        drawn.append(quantity(history, drawing.plates_in(case)))
        axes.plot(
            history.t,
            drawn[-1],
            color=colour,
            linestyle=dashes,
            linewidth=width,
            label=label,
        )
    time_axis(axes, drawing)
    return drawn
