"""The figures of a run, as PNG files: those of all experiments, and those that belong to what happens in this one.

Each is a `Page`, a table of panels over time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gridpeers.scenarios.results import metrics
from gridpeers.scenarios.results.history import Floats, History
from gridpeers.scenarios.results.island_membership import RowMeasure, part_of, worst
from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.plots.style import (
    BLACK,
    PAGE,
    STYLES,
    Bounds,
    Format,
    Style,
    from_zero,
    legend_below,
    mark_events,
    note_above,
    save,
    stacked_styles,
)
from gridpeers.wire.wording import suggestion

WIDTH = 7.4  # Width of a page (inches)
TITLE_LENGTH = 48  # Characters of a panel's title that fit above half a page
LOST = 0.3  # Distance from nominal (Hz) at which a frequency that does not come back leaves the frame
MARKERS, MARKED = "osD^vP", 5  # Of inverters in turn, and how many each has
ROUNDS = ("-", "--", ":", "-.")  # Lines of the first inverters, of those that have their colours again, and so on

MOVER: Style = ("#d55e00", "-", 2.2)
STAYERS: dict[bool, Style] = {True: ("#0072b2", "-", 1.6), False: ("#56b4e9", "--", 1.2)}
"""Styles of inverters that leave or join, and of the others: grid-forming, or not."""

PAIR: tuple[Style, Style] = (("#0072b2", "-", 2.2), ("#d55e00", (0, (4, 2)), 1.6))
"""Styles of two runs: the second lies on top, dashed and thinner, so that equal ones are both seen."""

P_LABEL = "P (pu of rating)"


class PanelCurve(NamedTuple):
    t: Floats
    y: Floats
    style: Style
    label: str = ""
    """Its words in the legend; "" for a curve that has none."""
    marks: tuple[str, int, int] | None = None
    """Marker, row of the first one, and rows from one to the next; None: no markers."""


class Panel(NamedTuple):
    title: str
    label: str
    """Label of the axis, with the unit."""
    curves: list[PanelCurve]
    nominal: float | None = None
    """Value at which the axis has a line."""
    bounds: Bounds | None = None
    """End of an axis that starts at 0."""
    lost: float | None = None
    """Distance from nominal at which curves that do not come back leave the frame; None: they do not."""


class Page(NamedTuple):
    """Panels in rows, of which the last may be shorter; the first panel has the curves of the legend."""

    rows: Sequence[Sequence[Panel]]
    size: tuple[float, float]
    """Width and height (inches)."""
    share_y: bool | Literal["none", "row"] = "none"
    title: str = ""
    """Title of a page whose panels each say what happens at the events, not those of the first row alone."""
    one_row: bool = False
    """True if the legend has one row."""


def _fill(axes: Axes, panel: Panel) -> None:
    for t, y, (colour, dashes, width), label, marks in panel.curves:
        (line,) = axes.plot(t, y, color=colour, linestyle=dashes, linewidth=width, label=label)
        if marks:
            sign: Any = {"marker": marks[0], "markevery": marks[1:], "ms": 5.0, "mec": "white", "mew": 0.5}
            line.set(**sign)
            axes.plot(t, y, color=colour, linestyle="none", zorder=3, **sign)  # above all lines
    axes.set_title(panel.title, loc="left")
    axes.set_ylabel(panel.label)
    axes.set_xlabel("time (s)")
    if panel.nominal is not None:
        axes.axhline(panel.nominal, color=BLACK, linewidth=0.6, zorder=1)
        axes.ticklabel_format(axis="y", useOffset=False)  # numbers near it in full
    if panel.bounds is not None:
        from_zero(axes, [curve.y for curve in panel.curves], panel.bounds)
    if panel.nominal is not None and panel.lost is not None:
        _keep_in_view(axes, panel.curves, panel.nominal, panel.lost)


def _keep_in_view(axes: Axes, curves: Sequence[PanelCurve], nominal: float, most: float) -> None:
    lost = [curve for curve in curves if abs(curve.y[-1] - nominal) > most]
    if lost and len(lost) < len(curves):
        low, high = axes.get_ylim()
        axes.set_ylim(max(low, nominal - most), min(high, nominal + most))
        for curve in lost:
            text = f"{curve.label.partition(':')[0]}: {curve.y[-1]:.2f} Hz at the end"
            note_above(axes, text, 1.0, "axes fraction", "right")


def drawn(page: Page, drawing: Drawing) -> Figure:
    figure = Figure(figsize=page.size, layout="constrained")
    columns = len(page.rows[0])
    grid = figure.subplots(len(page.rows), columns, sharex=True, sharey=page.share_y, squeeze=False)
    panels = [panel for row in page.rows for panel in row]
    for place, axes in enumerate(grid.flat):
        if place >= len(panels):
            axes.set_visible(False)
            continue
        _fill(axes, panels[place])
        axes.set_xlim(0.0, drawing.end)
        mark_events(axes, drawing, labelled=place < columns or bool(page.title))
        lowest = place + columns >= len(panels)
        axes.tick_params(labelbottom=lowest)
        if not lowest:
            axes.set_xlabel("")
    if page.title:
        figure.suptitle(page.title, fontsize=10)
    legend_below(figure, grid[0, 0], one_row=page.one_row)
    return figure


class PlotMeasure(NamedTuple):
    title: str
    label: str
    """Label of the axis, with the unit."""
    of_row: RowMeasure
    nominal: float | None
    """Value from which islands depart; None: the nominal frequency."""
    bounds: Bounds | None = None
    """End of an axis that starts at 0; None: the axis has a line at the nominal value instead."""


_SHARING = Bounds(most=5.0)  # The indices have no bound where little is shared: ours go up to 4 after an event
_VOLTAGE = Bounds(least=0.01, shown=0.98)  # Spikes at a switching are ten times what is left of them, and last longer

MEASURES = {
    "frequency": PlotMeasure("Frequency", "mean of the GFM, f (Hz)", metrics.mean_frequency, None),
    "MPSI": PlotMeasure("Mean power sharing index, MPSI", "MPSI", metrics.MPSI, 0.0, _SHARING),
    "V_error": PlotMeasure("Voltage error, V_error", "mean of abs(V - 1) (pu)", metrics.V_error, 0.0, _VOLTAGE),
    "voltage": PlotMeasure("Mean voltage", "mean of all inverters, V (pu)", metrics.mean_voltage, 1.0),
    "MQSI": PlotMeasure("Mean var sharing index, MQSI", "MQSI", metrics.MQSI, 0.0, _SHARING),
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
    title = f"{measure.title}, worst island" if drawing.island_intervals else measure.title
    nominal = drawing.f_nom if measure.nominal is None else measure.nominal
    curves = _case_curves(drawing, lambda case, _: measured(drawing, case, name))
    return Panel(title, measure.label, curves, None if measure.bounds else nominal, measure.bounds)


def overview(drawing: Drawing) -> Page:
    panels = [_measure_panel(drawing, name) for name in JUDGED]
    return Page([panels[:2], panels[2:]], (WIDTH, 4.6))


def single(drawing: Drawing, name: str) -> Page:
    return Page([[_measure_panel(drawing, name)]], (6.4, 3.2))


def _case_title(drawing: Drawing, case: str) -> str:
    return "\n".join(wrap(f"Case {drawing.words(case)}", TITLE_LENGTH))


def plug_and_play(drawing: Drawing) -> Page:
    """Return P of every inverter, f and V below each other, a column for each case: the paper's figure."""
    nameplates = drawing.nameplates
    stays = np.all([history.present.all(axis=0) for history in drawing.histories.values()], axis=0)
    styles = [STAYERS[bool(GFM)] if stay else MOVER for GFM, stay in zip(nameplates.GFM, stays, strict=True)]
    movers = ", ".join(name for name, stay in zip(nameplates.names, stays, strict=True) if not stay)
    words = {MOVER: movers, STAYERS[True]: "grid-forming", STAYERS[False]: "grid-following"}
    labels = [words.pop(style, "") for style in styles]  # the first curve of a style is in the legend
    rows: list[list[Panel]] = [[], [], []]
    for (case, history), style in zip(drawing.histories.items(), stacked_styles(len(drawing.histories)), strict=True):
        powers = zip((history.P / nameplates.s).T, styles, labels, strict=True)
        f, V = (of(history, nameplates) for of in (metrics.mean_frequency, metrics.mean_voltage))
        of_rows = (
            Panel(_case_title(drawing, case), P_LABEL, [PanelCurve(history.t, *each) for each in powers]),
            Panel("", "f, mean of the GFM (Hz)", [PanelCurve(history.t, f, style)], drawing.f_nom),
            Panel("", "mean V (pu)", [PanelCurve(history.t, V, style)]),
        )
        for row, panel in zip(rows, of_rows, strict=True):
            row.append(panel._replace(label="") if row else panel)
    return Page(rows, (max(3.7 * len(drawing.histories), 5.2), 5.4), share_y="row", one_row=True)


def powers(drawing: Drawing, *, GFM: bool) -> Page:
    nameplates = drawing.nameplates
    series = {
        case: {nameplates.names[i]: (of.t, of.P[:, i] / nameplates.s[i]) for i in np.flatnonzero(nameplates.GFM == GFM)}
        for case, of in drawing.histories.items()
    }
    title = f"Real power of the {'grid-forming' if GFM else 'grid-following'} inverters"
    return _by_inverter(drawing, series, P_LABEL, title)


def shared(drawing: Drawing, name: str) -> Page:
    quantity, frames = drawing.shared[name]
    series = {
        case: {it: (sent.index.to_numpy(), sent.to_numpy()) for it in frame if (sent := frame[it].dropna()).size}
        for case, frame in frames.items()
    }
    label = f"{name} ({quantity.unit})" if quantity.unit else name
    page = _by_inverter(drawing, series, label, f"{name}: {quantity.help}".rstrip(" .:"))
    return page._replace(one_row=False)


def _by_inverter(
    drawing: Drawing, series: Mapping[str, Mapping[str, tuple[Floats, Floats]]], label: str, title: str
) -> Page:
    columns, panels = 2 if len(series) > 1 else 1, []
    for place, (case, of_case) in enumerate(series.items()):
        widths = np.linspace(2.4, 0.9, len(of_case))  # wide below narrow: where curves coincide all of them are seen
        curves = []
        for number, (name, (t, y)) in enumerate(of_case.items()):
            again, of = divmod(number, len(STYLES))  # more inverters than colours: those of a later round dashed
            step = max(len(t) // MARKED, 1)  # markers in turn: they tell curves apart that lie on one another
            marks = MARKERS[number % len(MARKERS)], number * step // len(of_case), step
            curves.append(PanelCurve(t, y, (STYLES[of][0], ROUNDS[again % len(ROUNDS)], widths[number]), name, marks))
        panels.append(Panel(_case_title(drawing, case), "" if place % columns else label, curves))
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    size = (3.7 * columns + (2.0 if len(panels) == 1 else 0.0), 2.0 * len(rows) + 0.6)
    return Page(rows, size, share_y=True, title=title, one_row=True)


def available_power(drawing: Drawing) -> Page:
    """Return P of the first limited inverter and the mean of the others, f, and P_set - P of the limited one, by case.

    A frequency that falls for good leaves the frame instead of flattening all others.
    """
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
        _measure_panel(drawing, "frequency")._replace(lost=LOST),
        Panel(f"Set-point of {first} ahead of its power", "P_set - P (pu of rating)", ahead),
    ]
    return Page([top, bottom], (WIDTH, 4.8))


def microgrids(drawing: Drawing, case: str) -> Page:
    """Return P and Q in total, f and mean V over time of each part that is an island when there are most."""
    panels = [
        Panel("Real power", "P in total (kW)", []),
        Panel("Reactive power", "Q in total (kvar)", []),
        Panel("Frequency", "mean of its GFM, f (Hz)", [], drawing.f_nom),
        Panel("Voltage", "mean of its inverters, V (pu)", [], 1.0),
    ]
    islands = drawing.most_islands(case).values()
    for island, style in zip(islands, stacked_styles(len(islands)), strict=True):
        history, nameplates = part_of(drawing.histories[case], drawing.nameplates, island.inverters)
        total = (power.sum(axis=1) / 1e3 for power in (history.P, history.Q))
        means = (of(history, nameplates) for of in (metrics.mean_frequency, metrics.mean_voltage))
        for panel, y in zip(panels, (*total, *means), strict=True):
            panel.curves.append(PanelCurve(history.t, y, style, drawing.island_title(island)))
    return Page([panels[:2], panels[2:]], (WIDTH, 4.6), one_row=True)


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
                _fill(axes, Panel(title, measure.label, curves, bounds=measure.bounds))
                axes.ticklabel_format(axis="y", useOffset=False)
                axes.set_xlim(0.0, longer.end)
                mark_events(axes, replace(longer, events=list(colours)), labelled=place < 2, colours=colours)
        legend_below(figure, grid[0, 0])
    return figure


def figures_of(drawing: Drawing) -> dict[str, Callable[[], Page]]:
    figures: dict[str, Callable[[], Page]] = {name: partial(single, drawing, name) for name in MEASURES}
    figures |= {f"power_{kind}": partial(powers, drawing, GFM=kind == "GFM") for kind in ("GFM", "GFL")}
    figures["overview"] = partial(overview, drawing)
    if drawing.moves:
        figures["plug-n-play"] = partial(plug_and_play, drawing)
    if drawing.limited:
        figures["available-power"] = partial(available_power, drawing)
    figures |= {name: partial(shared, drawing, name) for name in drawing.shared if name not in figures}
    return figures | {f"microgrids_{case}": partial(microgrids, drawing, case) for case in drawing.island_intervals}


def draw(drawing: Drawing, name: str) -> Figure:
    """Draw one figure of a run in the style of all. Raise ValueError if the run has no figure of this name."""
    figures = figures_of(drawing)
    if name not in figures:
        raise ValueError(f'there is no figure "{name}" of this run; {suggestion(name, figures, "figures")}')
    with mpl.rc_context(PAGE):
        return drawn(figures[name](), drawing)


def draw_all(drawing: Drawing, folder: Path, kind: Format = "png") -> tuple[Path, ...]:
    """Draw the figures of a run into a folder, but those of a single measure: the overview has them, or `draw` does."""
    names = (name for name in figures_of(drawing) if name not in MEASURES)
    return tuple(file for name in names for file in save(draw(drawing, name), folder, name, (kind,)))
