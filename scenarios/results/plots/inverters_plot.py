"""P of every inverter: by kind and case, and while one leaves and returns."""

from __future__ import annotations

from dataclasses import replace

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from scenarios.results import metrics
from scenarios.results.drawing import Drawing
from scenarios.results.plots.cases import curves
from scenarios.results.plots.marks import mark_events
from scenarios.results.plots.style import MOVER, OTHER_STYLES, PAGE, STAYERS, case_title, time_axis


def plug_and_play(drawing: Drawing) -> Figure:
    """P of every inverter, frequency and voltage below each other, a column for each case: the paper's figure."""
    with mpl.rc_context(PAGE):
        count = len(drawing.histories)
        figure = Figure(figsize=(max(3.7 * count, 5.2), 5.4), layout="constrained")
        grid = figure.subplots(3, count, sharex=True, sharey="row", squeeze=False)
        for (top, middle, bottom), (case, history) in zip(grid.T, drawing.histories.items(), strict=True):
            alone = replace(drawing, histories={case: history})
            present = history.present
            for i, name in enumerate(drawing.plates.names):
                colour, dashes, width = MOVER if not present[:, i].all() else STAYERS[drawing.plates.GFM[i]]
                top.plot(history.t, history.P[:, i] / drawing.plates.s[i], dashes, color=colour, lw=width, label=name)
            top.set_title(case_title(drawing, case), loc="left")
            curves(middle, alone, metrics.mean_frequency)
            middle.axhline(drawing.f_nom, color="#000000", linewidth=0.6, zorder=1)
            middle.ticklabel_format(axis="y", useOffset=False)
            curves(bottom, alone, metrics.mean_voltage)
            for panel in (top, middle, bottom):
                time_axis(panel, alone)
                mark_events(panel, drawing, labelled=panel is top)
        for panel in grid[:-1].flat:
            panel.set_xlabel("")
        for panel, label in zip(
            grid[:, 0], ("P (pu of rating)", "f, mean of the GFM (Hz)", "mean V (pu)"), strict=True
        ):
            panel.set_ylabel(label)
        lines = {line.get_color(): line for line in grid[0, 0].get_lines() if line.get_label() in drawing.plates.names}
        on = np.all([history.present.all(axis=0) for history in drawing.histories.values()], axis=0)
        movers = ", ".join(name for name, stays in zip(drawing.plates.names, on.tolist(), strict=True) if not stays)
        kinds = {MOVER[0]: movers, STAYERS[True][0]: "grid-forming", STAYERS[False][0]: "grid-following"}
        shown = [(line, kinds[str(colour)]) for colour, line in lines.items()]
        handles, labels = [line for line, _ in shown], [label for _, label in shown]
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def powers(drawing: Drawing, *, GFM: bool) -> Figure:
    """P of each inverter of one kind (pu of its rating), one panel per case."""
    count = len(drawing.histories)
    columns = 2 if count > 1 else 1
    rows = -(-count // columns)
    size = (3.7 * columns + (2.0 if count == 1 else 0.0), 2.0 * rows + 0.6)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    chosen = np.flatnonzero(drawing.plates.GFM == GFM)
    widths = np.linspace(2.4, 0.9, len(chosen))  # wide below narrow: where curves coincide all of them are seen
    for panel, (case, history) in zip(grid.flat, drawing.histories.items(), strict=False):
        for number, i in enumerate(chosen):
            colour = OTHER_STYLES[number % len(OTHER_STYLES)][0]
            panel.plot(
                history.t,
                history.P[:, i] / drawing.plates.s[i],
                color=colour,
                linewidth=widths[number],
                label=drawing.plates.names[i],
            )
        panel.set_title(case_title(drawing, case), loc="left")
        time_axis(panel, drawing)
        mark_events(panel, drawing, labelled=True)
    for panel in grid.flat[count:]:
        panel.set_visible(False)
    for panel in grid[:, 0]:
        panel.set_ylabel("P (pu of rating)")
    for above, below in zip(grid[:-1].flat, grid[1:].flat, strict=True):
        if below.get_visible():
            above.set_xlabel("")
        else:
            above.tick_params(labelbottom=True)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.suptitle(f"Real power of the {'grid-forming' if GFM else 'grid-following'} inverters", fontsize=10)
    figure.legend(handles, labels, loc="outside lower center", ncols=max(len(labels), 1))
    return figure
