"""Figures of single inverters and of islands: powers by kind, plug-n-play, available power, microgrid switching."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.results.island_membership import part_of
from gridpeers.scenarios.results.plots.case_figures import curves, draw_measure
from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.plots.marks import finish, mark_events, note_above
from gridpeers.scenarios.results.plots.style import (
    MOVER,
    OTHER_STYLES,
    STAYERS,
    case_styles,
    case_title,
    legend_below,
    name_panel,
    nominal_line,
    time_axis,
    widths,
)

ROUNDS = ("-", "--", ":", "-.")  # Lines of the first inverters, of those that have their colours again, and so on


def plug_and_play(drawing: Drawing) -> Figure:
    """Draw P of every inverter, frequency and voltage below each other, a column for each case: the paper's figure."""
    count, nameplates = len(drawing.histories), drawing.nameplates
    figure = Figure(figsize=(max(3.7 * count, 5.2), 5.4), layout="constrained")
    grid = figure.subplots(3, count, sharex=True, sharey="row", squeeze=False)
    stays = np.all([history.present.all(axis=0) for history in drawing.histories.values()], axis=0)
    for (top, middle, bottom), (case, history) in zip(grid.T, drawing.histories.items(), strict=True):
        alone, absent = replace(drawing, histories={case: history}), ~history.present
        for i, name in enumerate(nameplates.names):
            colour, dashes, width = MOVER if absent[:, i].any() else STAYERS[nameplates.GFM[i]]
            top.plot(history.t, history.P[:, i] / nameplates.s[i], dashes, color=colour, lw=width, label=name)
        top.set_title(case_title(drawing, case), loc="left")
        counted = drawing.nameplates_in(case)
        curves(middle, alone, {case: metrics.mean_frequency(history, counted)})
        nominal_line(middle, drawing.f_nom)
        curves(bottom, alone, {case: metrics.mean_voltage(history, counted)})
    for panel, label in zip(grid[:, 0], ("P (pu of rating)", "f, mean of the GFM (Hz)", "mean V (pu)"), strict=True):
        panel.set_ylabel(label)
    lines = {line.get_color(): line for line in grid[0, 0].get_lines()}
    movers = ", ".join(name for name, here in zip(nameplates.names, stays.tolist(), strict=True) if not here)
    kinds = {MOVER[0]: movers, STAYERS[True][0]: "grid-forming", STAYERS[False][0]: "grid-following"}
    shown = [(line, kinds[str(colour)]) for colour, line in lines.items()]
    figure.legend(*zip(*shown, strict=True), loc="outside lower center", ncols=len(shown))
    finish(grid, drawing)
    return figure


def powers(drawing: Drawing, *, GFM: bool) -> Figure:
    """Draw P of each inverter of one kind (pu of its rating), one panel per case."""
    count = len(drawing.histories)
    columns = 2 if count > 1 else 1
    rows = -(-count // columns)
    size = (3.7 * columns + (2.0 if count == 1 else 0.0), 2.0 * rows + 0.6)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    chosen = np.flatnonzero(drawing.nameplates.GFM == GFM)
    widths = np.linspace(2.4, 0.9, len(chosen))  # wide below narrow: where curves coincide all of them are seen
    for panel, (case, history) in zip(grid.flat, drawing.histories.items(), strict=False):
        for number, i in enumerate(chosen):
            again, of = divmod(number, len(OTHER_STYLES))  # more inverters than colours: those of a later round dashed
            panel.plot(
                history.t,
                history.P[:, i] / drawing.nameplates.s[i],
                linestyle=ROUNDS[again % len(ROUNDS)],
                color=OTHER_STYLES[of][0],
                linewidth=widths[number],
                label=drawing.nameplates.names[i],
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
    figure.suptitle(f"Real power of the {'grid-forming' if GFM else 'grid-following'} inverters", fontsize=10)
    legend_below(figure, grid[0, 0], one_row=True)
    return figure


LOST = 0.3  # Distance from nominal (Hz) at which a frequency that does not come back leaves the frame


def available_power(drawing: Drawing) -> Figure:
    """Draw P of the first limited inverter and the mean of the others, f, and P_set - P of the limited one, by case."""
    first = drawing.limited[0]
    at = drawing.nameplates.names.index(first)
    others = np.array([name not in drawing.limited for name in drawing.nameplates.names])
    figure = Figure(figsize=(7.4, 4.8), layout="constrained")
    grid = figure.subplots(2, 2, sharex=True)
    top, beside, below, last = grid.flat
    for (colour, dashes, width), history in zip(
        case_styles(drawing.histories).values(), drawing.histories.values(), strict=True
    ):
        share = history.P / drawing.nameplates.s
        ahead = history.P_set[:, at] / drawing.nameplates.s[at] - share[:, at]
        for panel, y in ((top, share[:, at]), (beside, share[:, others].mean(axis=1)), (last, ahead)):
            panel.plot(history.t, y, linestyle=dashes, color=colour, linewidth=width)
    beside.axhline(1.0, color="#000000", linewidth=0.6, zorder=1)
    draw_measure(below, drawing, "frequency")
    _keep_in_view(below, drawing)
    name_panel(top, f"Power of {first}", "P (pu of rating)")
    name_panel(beside, "Power of the inverters that are not limited", "their mean, P (pu of rating)")
    name_panel(last, f"Set-point of {first} ahead of its power", "P_set - P (pu of rating)")
    finish(grid, drawing)
    legend_below(figure, below)
    return figure


def _keep_in_view(axes: Axes, drawing: Drawing) -> None:
    """Let a frequency that falls for good leave the frame instead of flattening all others."""
    ends = {case: float(history.f[-1, drawing.nameplates.GFM].mean()) for case, history in drawing.histories.items()}
    lost = [case for case, f in ends.items() if abs(f - drawing.f_nom) > LOST]
    if lost and len(lost) < len(ends):
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, drawing.f_nom - LOST), min(high, drawing.f_nom + LOST))
        for case in lost:
            note_above(axes, f"{case}: {ends[case]:.2f} Hz at the end", 1.0, "axes fraction", "right")


def microgrids(drawing: Drawing, case: str) -> Figure:
    """Draw P and Q in total, f and mean V over time of each part that is an island when there are most."""
    figure = Figure(figsize=(7.4, 4.6), layout="constrained")
    grid = figure.subplots(2, 2, sharex=True)
    islands = drawing.most_islands(case)
    width = widths(len(islands))
    for number, island in enumerate(islands.values()):
        history, nameplates = part_of(drawing.histories[case], drawing.nameplates, island.inverters)
        label, (colour, dashes) = drawing.island_title(island), OTHER_STYLES[number % len(OTHER_STYLES)]
        values = (
            history.P.sum(axis=1) / 1e3,
            history.Q.sum(axis=1) / 1e3,
            metrics.mean_frequency(history, nameplates),
            metrics.mean_voltage(history, nameplates),
        )
        for panel, y in zip(grid.flat, values, strict=True):
            panel.plot(history.t, y, linestyle=dashes, color=colour, linewidth=width[number], label=label)
    name_panel(grid[0, 0], "Real power", "P in total (kW)")
    name_panel(grid[0, 1], "Reactive power", "Q in total (kvar)")
    name_panel(grid[1, 0], "Frequency", "mean of its GFM, f (Hz)")
    name_panel(grid[1, 1], "Voltage", "mean of its inverters, V (pu)")
    nominal_line(grid[1, 0], drawing.f_nom)
    nominal_line(grid[1, 1], 1.0)
    finish(grid, drawing)
    legend_below(figure, grid[0, 0], one_row=True)
    return figure
