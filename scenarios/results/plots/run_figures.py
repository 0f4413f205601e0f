"""The figures of a run, as PNG files: those of all experiments, and those that belong to what happens in this one.

Each is a page of panels over time: `Panel` says what is in one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.results.history import Floats, History, Nameplates
from gridpeers.scenarios.results.island_membership import RowMeasure, part_of, worst
from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.plots.style import (
    BLACK,
    PAGE,
    STYLES,
    Bounds,
    Style,
    from_zero,
    legend_below,
    mark_events,
    name_panel,
    nominal_line,
    note_above,
    save,
    stacked_styles,
    time_axis,
)
from gridpeers.scenarios.results.sharing_index import NO_LOAD, total_load
from gridpeers.wire.wording import suggestion

WIDTH = 7.4  # Width of a page (inches)
TITLE_LENGTH = 48  # Characters of a panel's title that fit above half a page
LOST = 0.3  # Distance from nominal (Hz) at which a frequency that does not come back leaves the frame
ROUNDS = ("-", "--", ":", "-.")  # Lines of the first inverters, of those that have their colours again, and so on

MOVER: Style = ("#d55e00", "-", 2.2)
"""Style of an inverter that leaves or joins, among all others."""

STAYERS: dict[bool, Style] = {True: ("#0072b2", "-", 1.6), False: ("#56b4e9", "--", 1.2)}
"""Styles of the others: grid-forming, or not."""

PAIR: tuple[Style, Style] = (("#0072b2", "-", 2.2), ("#d55e00", (0, (4, 2)), 1.6))
"""Styles of two runs: the second lies on top, dashed and thinner, so that equal ones are both seen."""

P_LABEL = "P (pu of rating)"


class PanelCurve(NamedTuple):
    t: Floats
    y: Floats
    style: Style
    label: str


class Panel(NamedTuple):
    title: str
    label: str
    """Label of the axis, with the unit."""
    curves: Sequence[PanelCurve]
    nominal: float | None = None
    """Value at which the axis has a line."""
    bounds: Bounds | None = None
    """End of an axis that starts at 0."""


def _fill(axes: Axes, panel: Panel) -> None:
    for t, y, (colour, dashes, width), label in panel.curves:
        axes.plot(t, y, color=colour, linestyle=dashes, linewidth=width, label=label)
    name_panel(axes, panel.title, panel.label)
    if panel.nominal is not None:
        nominal_line(axes, panel.nominal)
    if panel.bounds is not None:
        from_zero(axes, [curve.y for curve in panel.curves], panel.bounds)


def _page(
    drawing: Drawing, rows: Sequence[Sequence[Panel]], size: tuple[float, float], **shared: Any
) -> tuple[Figure, Any]:
    """Draw panels with words on events above the top row, and the time below the bottom row."""
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(len(rows), len(rows[0]), sharex=True, squeeze=False, **shared)
    for row, (places, panels) in enumerate(zip(grid, rows, strict=True)):
        for axes, panel in zip(places, panels, strict=True):
            _fill(axes, panel)
            time_axis(axes, drawing)
            mark_events(axes, drawing, labelled=row == 0)
            if row < len(rows) - 1:
                axes.set_xlabel("")
    return figure, grid


def _where_shared(index: RowMeasure, power: str) -> RowMeasure:
    """Return a sharing index that is no number where the total is below `NO_LOAD` of the ratings: it divides dust."""

    def measure(history: History, nameplates: Nameplates) -> Floats:
        sharing = history.present & nameplates.shares
        load = total_load(getattr(history, power), nameplates.s, sharing)
        return np.where(load < NO_LOAD, np.nan, index(history, nameplates))

    return measure


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


_SHARING = Bounds(most=5.0)  # The indices have no bound where little is shared: ours go up to 4 after an event
_VOLTAGE = Bounds(least=0.01, shown=0.98)  # Spikes at a switching are ten times what is left of them, and last longer

MEASURES = {
    "frequency": PlotMeasure("Frequency", "mean of the GFM, f (Hz)", "f (Hz)", metrics.mean_frequency, None),
    "MPSI": PlotMeasure(
        "Mean power sharing index, MPSI", "MPSI", "MPSI", _where_shared(metrics.MPSI, "P"), 0.0, _SHARING
    ),
    "V_error": PlotMeasure(
        "Voltage error, V_error", "mean of abs(V - 1) (pu)", "V_error (pu)", metrics.V_error, 0.0, _VOLTAGE
    ),
    "voltage": PlotMeasure("Mean voltage", "mean of all inverters, V (pu)", "mean V (pu)", metrics.mean_voltage, 1.0),
    "MQSI": PlotMeasure(
        "Mean var sharing index, MQSI", "MQSI", "MQSI", _where_shared(metrics.MQSI, "Q"), 0.0, _SHARING
    ),
}
"""By the name of their figure. V_error judges the voltages: in the mean voltage, which the paper's figure shows,
terminals that are too high and too low cancel."""

JUDGED = ("frequency", "MPSI", "V_error", "MQSI")  # Measures by which runs are judged


def measured(drawing: Drawing, case: str, name: str) -> Floats:
    """Return one of `MEASURES` of a case, row by row; of the worst island while there are several."""
    measure, intervals = MEASURES[name], drawing.island_intervals.get(case, ())
    nominal = drawing.f_nom if measure.nominal is None else measure.nominal
    nameplates = drawing.nameplates.without(drawing.without_agent.get(case, frozenset()))
    return worst(measure.of_row, nominal, intervals, drawing.histories[case], nameplates)


def _case_curves(drawing: Drawing, values: Callable[[str, History], Floats]) -> list[PanelCurve]:
    """Return a curve for each case; the later ones lie on top."""
    styles = stacked_styles(len(drawing.histories))
    return [
        PanelCurve(history.t, values(case, history), style, drawing.words(case))
        for (case, history), style in zip(drawing.histories.items(), styles, strict=True)
    ]


def _measure_panel(drawing: Drawing, name: str) -> Panel:
    measure = MEASURES[name]
    label = f"{measure.island_label}, worst island" if drawing.island_intervals else measure.label
    nominal = drawing.f_nom if measure.nominal is None else measure.nominal
    curves = _case_curves(drawing, lambda case, _: measured(drawing, case, name))
    return Panel(measure.title, label, curves, None if measure.bounds else nominal, measure.bounds)


def overview(drawing: Drawing) -> Figure:
    panels = [_measure_panel(drawing, name) for name in JUDGED]
    figure, grid = _page(drawing, [panels[:2], panels[2:]], (WIDTH, 4.6))
    legend_below(figure, grid[0, 0])
    return figure


def single(drawing: Drawing, name: str) -> Figure:
    figure, grid = _page(drawing, [[_measure_panel(drawing, name)]], (6.4, 3.2))
    legend_below(figure, grid[0, 0])
    return figure


def _case_title(drawing: Drawing, case: str) -> str:
    return "\n".join(wrap(f"Case {drawing.words(case)}", TITLE_LENGTH))


def plug_and_play(drawing: Drawing) -> Figure:
    """Draw P of every inverter, frequency and voltage below each other, a column for each case: the paper's figure."""
    nameplates = drawing.nameplates
    stays = np.all([history.present.all(axis=0) for history in drawing.histories.values()], axis=0)
    styles = [STAYERS[bool(GFM)] if stay else MOVER for GFM, stay in zip(nameplates.GFM, stays, strict=True)]
    rows: list[list[Panel]] = [[], [], []]
    for number, (case, history) in enumerate(drawing.histories.items()):
        shares = (history.P / nameplates.s).T
        powers = [PanelCurve(history.t, *each) for each in zip(shares, styles, nameplates.names, strict=True)]
        labels = (P_LABEL, "f, mean of the GFM (Hz)", "mean V (pu)") if number == 0 else ("", "", "")
        f, V = (of(history, nameplates) for of in (metrics.mean_frequency, metrics.mean_voltage))
        style = stacked_styles(len(drawing.histories))[number]
        rows[0].append(Panel(_case_title(drawing, case), labels[0], powers))
        rows[1].append(Panel("", labels[1], [PanelCurve(history.t, f, style, case)], drawing.f_nom))
        rows[2].append(Panel("", labels[2], [PanelCurve(history.t, V, style, case)]))
    figure, grid = _page(drawing, rows, (max(3.7 * len(drawing.histories), 5.2), 5.4), sharey="row")
    movers = ", ".join(name for name, stay in zip(nameplates.names, stays, strict=True) if not stay)
    words = {MOVER: movers, STAYERS[True]: "grid-forming", STAYERS[False]: "grid-following"}
    lines = dict(zip(styles, grid[0, 0].get_lines(), strict=False))
    kinds = [style for style in words if style in lines]
    handles, meanings = [lines[style] for style in kinds], [words[style] for style in kinds]
    figure.legend(handles, meanings, loc="outside lower center", ncols=len(kinds))
    return figure


def powers(drawing: Drawing, *, GFM: bool) -> Figure:
    """Draw P of each inverter of one kind (pu of its rating), one panel per case."""
    count, nameplates = len(drawing.histories), drawing.nameplates
    columns = 2 if count > 1 else 1
    rows = -(-count // columns)
    size = (3.7 * columns + (2.0 if count == 1 else 0.0), 2.0 * rows + 0.6)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    chosen = np.flatnonzero(nameplates.GFM == GFM)
    widths = np.linspace(2.4, 0.9, len(chosen))  # wide below narrow: where curves coincide all of them are seen
    for place, (axes, (case, history)) in enumerate(zip(grid.flat, drawing.histories.items(), strict=False)):
        curves = []
        for number, i in enumerate(chosen):
            again, of = divmod(number, len(STYLES))  # more inverters than colours: those of a later round dashed
            style = (STYLES[of][0], ROUNDS[again % len(ROUNDS)], widths[number])
            curves.append(PanelCurve(history.t, history.P[:, i] / nameplates.s[i], style, nameplates.names[i]))
        _fill(axes, Panel(_case_title(drawing, case), "" if place % columns else P_LABEL, curves))
        time_axis(axes, drawing)
        mark_events(axes, drawing, labelled=True)
        lowest = place + columns >= count
        axes.tick_params(labelbottom=lowest)
        if not lowest:
            axes.set_xlabel("")
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    figure.suptitle(f"Real power of the {'grid-forming' if GFM else 'grid-following'} inverters", fontsize=10)
    legend_below(figure, grid[0, 0], one_row=True)
    return figure


def available_power(drawing: Drawing) -> Figure:
    """Draw P of the first limited inverter and the mean of the others, f, and P_set - P of the limited one, by case."""
    first, s = drawing.limited[0], drawing.nameplates.s
    at = drawing.nameplates.names.index(first)
    others = np.array([name not in drawing.limited for name in drawing.nameplates.names])
    curves = partial(_case_curves, drawing)
    own = curves(lambda _, history: history.P[:, at] / s[at])
    rest = curves(lambda _, history: (history.P / s)[:, others].mean(axis=1))
    ahead = curves(lambda _, history: (history.P_set[:, at] - history.P[:, at]) / s[at])
    top = [
        Panel(f"Power of {first}", P_LABEL, own),
        Panel("Power of the inverters that are not limited", f"their mean, {P_LABEL}", rest, 1.0),
    ]
    bottom = [
        _measure_panel(drawing, "frequency"),
        Panel(f"Set-point of {first} ahead of its power", "P_set - P (pu of rating)", ahead),
    ]
    figure, grid = _page(drawing, [top, bottom], (WIDTH, 4.8))
    _keep_in_view(grid[1, 0], drawing)
    legend_below(figure, grid[1, 0])
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
    islands = drawing.most_islands(case).values()
    of: list[list[PanelCurve]] = [[], [], [], []]
    for island, style in zip(islands, stacked_styles(len(islands)), strict=True):
        history, nameplates = part_of(drawing.histories[case], drawing.nameplates, island.inverters)
        for curves, y in zip(
            of,
            (
                history.P.sum(axis=1) / 1e3,
                history.Q.sum(axis=1) / 1e3,
                metrics.mean_frequency(history, nameplates),
                metrics.mean_voltage(history, nameplates),
            ),
            strict=True,
        ):
            curves.append(PanelCurve(history.t, y, style, drawing.island_title(island)))
    top = [Panel("Real power", "P in total (kW)", of[0]), Panel("Reactive power", "Q in total (kvar)", of[1])]
    bottom = [
        Panel("Frequency", "mean of its GFM, f (Hz)", of[2], drawing.f_nom),
        Panel("Voltage", "mean of its inverters, V (pu)", of[3], 1.0),
    ]
    figure, grid = _page(drawing, [top, bottom], (WIDTH, 4.6))
    legend_below(figure, grid[0, 0], one_row=True)
    return figure


def comparison(pairs: Sequence[tuple[str, Mapping[str, Drawing]]]) -> Figure:
    """Draw two rows of panels for each pair of cases, and the events of both, in the colour of the one that has it."""
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(WIDTH, 0.4 + 4.6 * len(pairs)), layout="constrained")
        grid = figure.subplots(2 * len(pairs), 2, squeeze=False)
        for number, (words, drawings) in enumerate(pairs):
            marks = [dict.fromkeys(drawing.events) for drawing in drawings.values()]
            colours: dict[Any, str] = {}
            for of, style in zip(marks, PAIR, strict=True):
                colours |= {mark: BLACK if mark in colours else style[0] for mark in of}
            longer = max(drawings.values(), key=lambda drawing: drawing.end)
            for place, (axes, name) in enumerate(zip(grid[2 * number : 2 * number + 2].flat, JUDGED, strict=True)):
                measure, curves = MEASURES[name], []
                for (run, drawing), style in zip(drawings.items(), PAIR, strict=True):
                    ((case, history),) = drawing.histories.items()
                    curves.append(PanelCurve(history.t, measured(drawing, case, name), style, run))
                title = f"{words}: {measure.title}" if words else measure.title
                label = measure.island_label if name == "frequency" else measure.label
                _fill(axes, Panel(title, label, curves, bounds=measure.bounds))
                axes.ticklabel_format(axis="y", useOffset=False)
                time_axis(axes, longer)
                mark_events(axes, replace(longer, events=list(colours)), labelled=place < 2, colours=colours)
        legend_below(figure, grid[0, 0])
    return figure


def figures_of(drawing: Drawing) -> dict[str, Callable[[], Figure]]:
    figures: dict[str, Callable[[], Figure]] = {name: partial(single, drawing, name) for name in MEASURES}
    figures |= {f"power_{kind}": partial(powers, drawing, GFM=kind == "GFM") for kind in ("GFM", "GFL")}
    figures["overview"] = partial(overview, drawing)
    if drawing.moves:
        figures["plug-n-play"] = partial(plug_and_play, drawing)
    if drawing.limited:
        figures["available-power"] = partial(available_power, drawing)
    return figures | {f"microgrids_{case}": partial(microgrids, drawing, case) for case in drawing.island_intervals}


def draw(drawing: Drawing, name: str) -> Figure:
    """Draw one figure of a run in the style of all. Raise ValueError if the run has no figure of this name."""
    figures = figures_of(drawing)
    if name not in figures:
        raise ValueError(f'there is no figure "{name}" of this run; {suggestion(name, figures, "figures")}')
    with mpl.rc_context(PAGE):
        return figures[name]()


def draw_all(drawing: Drawing, folder: Path, number: int = 0, of: int = 1) -> tuple[Path, ...]:
    """Draw every figure of a run into a folder, or one of so many shares of them that take about the same time."""
    folder.mkdir(parents=True, exist_ok=True)
    figures = figures_of(drawing)
    with mpl.rc_context(PAGE):
        return tuple(file for name in _share(figures, number, of) for file in save(figures[name](), folder, name))


def _share(figures: Iterable[str], number: int, of: int) -> Iterator[str]:
    times = [0.0] * of
    for name in sorted(figures, key=lambda name: name != "overview"):  # which takes as long as two others
        least = times.index(min(times))
        times[least] += 2.5 if name == "overview" else 1.0
        if least == number:
            yield name
