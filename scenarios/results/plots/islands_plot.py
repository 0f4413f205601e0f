"""What each island carries and where its frequency and voltage stand: the paper's figures of microgrid switching."""

from __future__ import annotations

import matplotlib as mpl
from matplotlib.figure import Figure

from scenarios.results import metrics
from scenarios.results.drawing import Drawing
from scenarios.results.island_membership import part_of
from scenarios.results.plots.marks import mark_events
from scenarios.results.plots.style import OTHER_STYLES, PAGE, time_axis, widths


def microgrids(drawing: Drawing, case: str) -> Figure:
    """P and Q in total, f and mean V of each part that becomes an island, over time."""
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(7.4, 4.6), layout="constrained")
        grid = figure.subplots(2, 2, sharex=True)
        width = widths(len(drawing.islands))
        for number, (name, members) in enumerate(drawing.islands.items()):
            history, plates = part_of(drawing.histories[case], drawing.plates, members)
            colour, dashes = OTHER_STYLES[number % len(OTHER_STYLES)]
            values = (
                history.P.sum(axis=1) / 1e3,
                history.Q.sum(axis=1) / 1e3,
                metrics.mean_frequency(history, plates),
                metrics.mean_voltage(history, plates),
            )
            label = drawing.island_titles.get(name, f"island of {name}")
            for panel, y in zip(grid.flat, values, strict=True):
                panel.plot(history.t, y, linestyle=dashes, color=colour, linewidth=width[number], label=label)
        words = (
            ("Real power", "P in total (kW)"),
            ("Reactive power", "Q in total (kvar)"),
            ("Frequency", "mean of its GFM, f (Hz)"),
            ("Voltage", "mean of its inverters, V (pu)"),
        )
        for panel, (title, label) in zip(grid.flat, words, strict=True):
            panel.set_title(title, loc="left")
            panel.set_ylabel(label)
            panel.ticklabel_format(axis="y", useOffset=False)
            time_axis(panel, drawing)
            mark_events(panel, drawing, labelled=title in ("Real power", "Reactive power"))
        for panel, nominal in ((grid[1, 0], drawing.f_nom), (grid[1, 1], 1.0)):
            panel.axhline(nominal, color="#000000", linewidth=0.6, zorder=1)
        for panel in grid[0]:
            panel.set_xlabel("")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure
