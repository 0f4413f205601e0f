"""The paper's figures of a run, as PNG files: f, MPSI, mean V and MQSI of the cases, and P of every inverter.

One colour and one dash pattern per case, the same in every figure, after Okabe and Ito's palette, which stays apart
for colour-blind readers; with the patterns the curves can be told in a black-and-white print too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scenarios.results import metrics
from scenarios.results.history import Floats, History, Plates

Style = tuple[str, str, float]
"""Colour, dash pattern and line width."""

CASE_STYLES: dict[str, Style] = {
    "I": ("#7a7a7a", "-", 1.8),
    "II": ("#d55e00", "-", 2.0),
    "III": ("#009e73", "--", 1.6),
    "IV": ("#0072b2", "-", 2.0),
}
"""Styles of the paper's four cases. III is dashed and thinner: where it lies upon II, both are seen."""

OTHER_STYLES: tuple[Style, ...] = (
    ("#0072b2", "-", 1.8),
    ("#d55e00", "-", 1.8),
    ("#009e73", "--", 1.8),
    ("#cc79a7", "-.", 1.8),
    ("#e69f00", "-", 1.8),
    ("#56b4e9", "--", 1.8),
)
"""Styles of other cases, and of inverters, in turn."""

MOVER: Style = ("#d55e00", "-", 2.2)
"""Style of an inverter that leaves or joins, among all others."""

STAYERS: dict[bool, Style] = {True: ("#0072b2", "-", 1.6), False: ("#56b4e9", "--", 1.2)}
"""Styles of the others: grid-forming, or not."""

PAGE: Any = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titlepad": 14,
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "figure.dpi": 150,
    "savefig.dpi": 150,
}
"""Layout of every figure."""


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """What all figures of a run share."""

    histories: Mapping[str, History]
    """Recorded cases by name."""
    titles: Mapping[str, str]
    """A few words on each case."""
    plates: Plates
    """Nameplates, in the order of the histories' columns."""
    events: Sequence[tuple[str, float]]
    """Label and time (s) of each event."""
    f_nom: float
    """Nominal frequency (Hz)."""
    moves: bool = False
    """Whether inverters leave or join, which has a figure of its own."""


def draw_all(drawing: Drawing, folder: Path) -> tuple[Path, ...]:
    """Draw every figure of a run into a folder.

    Returns
    -------
    tuple of Path
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(PAGE):
        figures = {
            "frequency.png": _single(drawing, _frequency),
            "MPSI.png": _single(drawing, _MPSI),
            "voltage.png": _single(drawing, _voltage),
            "MQSI.png": _single(drawing, _MQSI),
            "power_GFM.png": _powers(drawing, GFM=True),
            "power_GFL.png": _powers(drawing, GFM=False),
            "overview.png": overview(drawing),
        }
        if drawing.moves:
            figures["plug-n-play.png"] = plug_and_play(drawing)
        for name, figure in figures.items():
            partial = folder / f".{name}"
            figure.savefig(partial, format="png")
            partial.replace(folder / name)
    return tuple(folder / name for name in figures)


def overview(drawing: Drawing) -> Figure:
    """All four measures of all cases on one page."""
    with mpl.rc_context(PAGE):
        figure = Figure(figsize=(9.0, 5.2), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True)
        for panel, draw in zip(axes.flat, (_frequency, _MPSI, _voltage, _MQSI), strict=True):
            draw(panel, drawing)
            _mark_events(panel, drawing, labelled=draw in (_frequency, _MPSI))
        for panel in axes[0]:
            panel.set_xlabel("")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def plug_and_play(drawing: Drawing) -> Figure:
    """P of every inverter, frequency and voltage below each other, a column for each case: the paper's figure."""
    with mpl.rc_context(PAGE):
        count = len(drawing.histories)
        figure = Figure(figsize=(5.2 * count + 1.2, 6.4), layout="constrained")
        grid = figure.subplots(3, count, sharex=True, sharey="row", squeeze=False)
        for (top, middle, bottom), (case, history) in zip(grid.T, drawing.histories.items(), strict=True):
            alone = replace(drawing, histories={case: history})
            present = history.present
            for i, name in enumerate(drawing.plates.names):
                colour, dashes, width = MOVER if not present[:, i].all() else STAYERS[drawing.plates.GFM[i]]
                top.plot(history.t, history.P[:, i] / drawing.plates.s[i], dashes, color=colour, lw=width, label=name)
            top.set_title(f"Case {case} {drawing.titles.get(case, '')}".strip(), loc="left")
            _curves(middle, alone, metrics.mean_frequency)
            middle.axhline(drawing.f_nom, color="#000000", linewidth=0.6, zorder=1)
            middle.ticklabel_format(axis="y", useOffset=False)
            _curves(bottom, alone, metrics.mean_voltage)
            for panel in (top, middle, bottom):
                _mark_events(panel, drawing, labelled=panel is top)
                _time_axis(panel, alone)
        for panel in grid[:-1].flat:
            panel.set_xlabel("")
        for panel, label in zip(
            grid[:, 0], ("P (pu of rating)", "f, mean of the GFM (Hz)", "mean V (pu)"), strict=True
        ):
            panel.set_ylabel(label)
        lines = {line.get_color(): line for line in grid[0, 0].get_lines() if line.get_label() in drawing.plates.names}
        words = {MOVER[0]: "", STAYERS[True][0]: "grid-forming", STAYERS[False][0]: "grid-following"}
        shown = [(line, words[str(colour)] or line.get_label()) for colour, line in lines.items()]
        handles, labels = [line for line, _ in shown], [label for _, label in shown]
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def case_style(case: str, number: int) -> Style:
    """Style of a case: fixed for the paper's four, else in turn.

    Examples
    --------
    >>> case_style("IV", 0) == CASE_STYLES["IV"], case_style("ring", 1) == OTHER_STYLES[1]
    (True, True)
    """
    return CASE_STYLES.get(case, OTHER_STYLES[number % len(OTHER_STYLES)])


def _single(drawing: Drawing, draw: Callable[[Axes, Drawing], None]) -> Figure:
    figure = Figure(figsize=(6.4, 3.2), layout="constrained")
    axes = figure.subplots()
    draw(axes, drawing)
    _mark_events(axes, drawing, labelled=True)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=len(drawing.histories))
    return figure


def _frequency(axes: Axes, drawing: Drawing) -> None:
    _curves(axes, drawing, metrics.mean_frequency)
    axes.axhline(drawing.f_nom, color="#000000", linewidth=0.6, zorder=1)
    axes.set_title("Frequency", loc="left")
    axes.set_ylabel("mean of the GFM, f (Hz)")
    axes.ticklabel_format(axis="y", useOffset=False)


def _MPSI(axes: Axes, drawing: Drawing) -> None:
    _curves(axes, drawing, metrics.MPSI)
    axes.set_title("Mean power sharing index, MPSI", loc="left")
    axes.set_ylabel("MPSI")
    _from_zero(axes, drawing, metrics.MPSI)


def _voltage(axes: Axes, drawing: Drawing) -> None:
    _curves(axes, drawing, metrics.mean_voltage)
    axes.axhline(1.0, color="#000000", linewidth=0.6, zorder=1)
    axes.set_title("Voltage", loc="left")
    axes.set_ylabel("mean of all inverters, V (pu)")
    axes.ticklabel_format(axis="y", useOffset=False)


def _MQSI(axes: Axes, drawing: Drawing) -> None:
    _curves(axes, drawing, metrics.MQSI)
    axes.set_title("Mean var sharing index, MQSI", loc="left")
    axes.set_ylabel("MQSI")
    _from_zero(axes, drawing, metrics.MQSI)


def _curves(axes: Axes, drawing: Drawing, quantity: Callable[[History, Plates], Floats]) -> None:
    """One curve per case; the later ones lie on top."""
    for number, (case, history) in enumerate(drawing.histories.items()):
        colour, dashes, width = case_style(case, number)
        title = drawing.titles.get(case, "")
        label = f"{case} {title}".strip()
        axes.plot(
            history.t, quantity(history, drawing.plates), color=colour, linestyle=dashes, linewidth=width, label=label
        )
    _time_axis(axes, drawing)


def _from_zero(axes: Axes, drawing: Drawing, quantity: Callable[[History, Plates], Floats]) -> None:
    """Start the axis at 0, and let spikes of a few ms at a switching leave the frame instead of flattening the rest."""
    values = np.concatenate([quantity(history, drawing.plates) for history in drawing.histories.values()])
    values = values[np.isfinite(values)]
    if not values.size:
        return
    top, peak = max(float(np.quantile(values, 0.995)) * 1.15, 0.05), float(values.max())
    axes.set_ylim(0.0, top)
    if peak > top:
        _note_above(axes, f"spikes reach {peak:.2g}", 1.0, "axes fraction", "right")


def _powers(drawing: Drawing, *, GFM: bool) -> Figure:
    """P of each inverter of one kind (pu of its rating), one panel per case."""
    count = len(drawing.histories)
    columns = 2 if count > 1 else 1
    rows = -(-count // columns)
    size = (4.5 * columns + (2.0 if count == 1 else 0.0), 2.3 * rows + 0.6)
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
        panel.set_title(f"Case {case} {drawing.titles.get(case, '')}".strip(), loc="left")
        _time_axis(panel, drawing)
        _mark_events(panel, drawing, labelled=True)
    for panel in grid.flat[count:]:
        panel.set_visible(False)
    for panel in grid[:, 0]:
        panel.set_ylabel("P (pu of rating)")
    for panel in grid[:-1].flat:
        panel.set_xlabel("")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.suptitle(f"Real power of the {'grid-forming' if GFM else 'grid-following'} inverters", fontsize=10)
    figure.legend(handles, labels, loc="outside lower center", ncols=max(len(labels), 1))
    return figure


def _time_axis(axes: Axes, drawing: Drawing) -> None:
    axes.set_xlabel("time (s)")
    axes.set_xlim(0.0, max(float(history.t[-1]) for history in drawing.histories.values()))


def _mark_events(axes: Axes, drawing: Drawing, *, labelled: bool) -> None:
    """Draw a fine line at each event, with its label above the frame, clear of the curves."""
    for label, t in drawing.events:
        axes.axvline(t, color="#000000", linewidth=0.7, linestyle=(0, (1, 2)), zorder=1)
        if labelled:
            _note_above(axes, label, t, "data", "center")


def _note_above(axes: Axes, text: str, x: float, of: str, side: Literal["center", "right"]) -> None:
    """Write small words above the frame, at x of the data or of the frame."""
    axes.annotate(
        text,
        (x, 1.0),
        xycoords=(of, "axes fraction"),
        xytext=(0, 2),
        textcoords="offset points",
        ha=side,
        fontsize=7,
        color="#444444",
    )
