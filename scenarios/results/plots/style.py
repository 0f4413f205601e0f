"""Style of all figures: line styles, the page, axes, marks of events, legends, reproducible files.

Colours are those of Okabe and Ito's palette, which stays apart for colour-blind readers; with the dash patterns the
curves differ in a black-and-white print too.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from itertools import zip_longest
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gridpeers.scenarios.results.history import Floats
from gridpeers.scenarios.results.plots.drawing import Drawing, Mark

warnings.filterwarnings("ignore", "Glyph .* missing from font", module=r"gridpeers\.")  # a box stands in its place

Style = tuple[str, Any, float]  # Colour, dash pattern and line width (pt)

STYLES: tuple[tuple[str, str], ...] = (
    ("#0072b2", "-"),
    ("#d55e00", "-"),
    ("#009e73", "--"),
    ("#cc79a7", "-."),
    ("#e69f00", "-"),
    ("#56b4e9", "--"),
)
"""Colours and dash patterns of cases, and of inverters, in turn."""

BLACK, GREY = "#000000", "#444444"
"""Colours of lines and words."""

PAGE: Any = {
    "font.size": 8,
    "axes.titlesize": 9,
    "axes.titlepad": 14,
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "figure.dpi": 180,
    "savefig.dpi": 180,
}


def stacked_styles(count: int) -> list[Style]:
    """Return styles of curves that are drawn one on top of the other: where they coincide, all of them are seen."""
    step = min(0.5, 1.8 / max(count - 1, 1))
    widths = [1.5 + step * above for above in reversed(range(count))] if count > 1 else [2.0] * count
    return [(*STYLES[number % len(STYLES)], width) for number, width in enumerate(widths)]


class Bounds(NamedTuple):
    """End of an axis that starts at 0."""

    least: float = 0.05
    """There or above, so that what is next to nothing looks like it."""
    shown: float = 0.995
    """Part of all values that it has."""
    most: float = inf


def from_zero(axes: Axes, curves: Iterable[Floats], bounds: Bounds) -> None:
    """Start the axis at 0, and let spikes of a few ms at a switching leave the frame instead of flattening the rest."""
    finite = [some for curve in curves if (some := curve[np.isfinite(curve)]).size]
    if not finite:
        return
    values = np.concatenate(finite)
    top = min(max(float(np.quantile(values, bounds.shown)) * 1.15, bounds.least), bounds.most)
    peak = float(values.max())
    axes.set_ylim(0.0, top)
    if peak > top:
        axes.annotate(
            f"up to {peak:.2g}",
            (0.995, 0.985),
            xycoords="axes fraction",
            ha="right",
            va="top",
            fontsize=7,
            color=GREY,
            bbox={"facecolor": "#ffffff", "edgecolor": "none", "pad": 1.0},
        )


def legend_below(figure: Figure, axes: Axes, *, one_row: bool = False) -> None:
    """Write the legend of some axes below a figure, in as many columns as fit, without a lonely last entry."""
    handles, labels = axes.get_legend_handles_labels()
    longest = max((len(label) for label in labels), default=1)
    fit = len(labels) if one_row else int(figure.get_figwidth() / (0.058 * longest + 0.42))
    rows = -(-len(labels) // max(fit, 1))
    figure.legend(handles, labels, loc="outside lower center", ncols=-(-len(labels) // rows) if labels else 1)


LETTER = 0.056  # Width of a letter of these texts (inches), a little more than the mean of DejaVu Sans at 7 pt
LONGEST = 20  # Letters of a word that is written whole
GAP = 0.06  # Least distance between two texts (inches)
MOST = 12.0  # Lines in an inch of a frame that leave its curves to be seen
FRAME = 0.78  # Part of a column of panels that is the frame of one; the rest are its axis and margins


def mark_events(
    axes: Axes, drawing: Drawing, *, labelled: bool, colours: Mapping[Mark, str] = MappingProxyType({})
) -> None:
    """Draw a fine line at each event; if labelled, say above the frame what happens, as far as there is room.

    Where the lines of all events would hide the curves, only events whose words have room get a line.
    """
    place, figure = axes.get_subplotspec(), axes.get_figure(root=True)
    assert figure is not None
    columns = 1 if place is None else place.get_gridspec().ncols
    width = float(figure.get_size_inches()[0]) / columns * FRAME  # roughly: the layout is made when it is drawn
    texts = event_texts(drawing.events, width / max(drawing.end, 1e-9))
    crowded = len(drawing.events) > MOST * width
    for mark in texts if crowded else drawing.events:
        axes.axvline(mark.t, color=colours.get(mark, BLACK), linewidth=0.7, linestyle=(0, (1, 2)), zorder=1)
    lines = 0
    for mark, text in texts.items() if labelled else ():
        colour = colours.get(mark, BLACK)
        note_above(axes, text, mark.t, "data", "left", colour=GREY if colour == BLACK else colour)
        lines = max(lines, text.count("\n") + 1)
    axes.set_title(axes.get_title(loc="left"), loc="left", pad=5.0 + 9.0 * lines)


def note_above(axes: Axes, text: str, x: float, of: str, side: Literal["left", "right"], *, colour: str = GREY) -> None:
    """Write small words above the frame, to the right of x, or with their right side there; x of the data or frame."""
    at: Any = {"xycoords": (of, "axes fraction"), "xytext": (0, 2), "textcoords": "offset points"}
    axes.annotate(text, (x, 1.0), **at, ha=side, fontsize=7, color=colour)


def event_texts(marks: Iterable[Mark], inches_per_s: float) -> dict[Mark, str]:
    """Return the text that begins at each mark: what happens if it ends before the next mark, else its label.

    A mark at which another text still goes on has none.
    """
    found: dict[Mark, str] = {}
    end, ordered = -inf, sorted(marks, key=lambda mark: mark.t)
    for mark, following in zip_longest(ordered, ordered[1:]):
        start = mark.t * inches_per_s
        room = (following.t * inches_per_s if following else inf) - start - GAP
        words = " ".join(word if len(word) <= LONGEST else f"{word[:9]}...{word[-8:]}" for word in mark.what.split(" "))
        full = ("\n".join(filter(None, (mark.label, text))) for text in (words, words.replace(" ", "\n", 1)))
        text = next((text for text in full if _width(text) <= room), mark.label)
        if text and start >= end:
            found[mark] = text
            end = start + _width(text) + GAP
    return found


def _width(text: str) -> float:
    return LETTER * max(map(len, text.split("\n")))


Format = Literal["png", "pdf", "svg"]  # Kind of file, as its name ends

_REPRODUCIBLE: Any = {"svg.hashsalt": "gridpeers", "svg.fonttype": "path", "pdf.fonttype": 42}
"""The salt stands in place of a random number from which an SVG's inner names are made. An SVG has letters as curves,
which look the same on every machine; a PDF has the font inside."""

_UNDATED: Mapping[Format, dict[str, Any]] = {"png": {}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}
"""Metadata that leave the time of writing out of a file."""


@mpl.rc_context(PAGE | _REPRODUCIBLE)
def save(
    figure: Figure, folder: Path, name: str, formats: Sequence[Format] = ("png",), dpi: float | None = None
) -> tuple[Path, ...]:
    """Write a figure into a folder, which is made where there is none."""
    folder.mkdir(parents=True, exist_ok=True)
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)  # once, as no file changes it; with the ticks that these sizes of text give
        figure.set_layout_engine("none")
    files = []
    for kind in formats:
        unfinished, file = folder / f".{name}.{kind}", folder / f"{name}.{kind}"
        with unfinished.open("wb") as stream:  # closed whatever goes wrong
            figure.savefig(stream, format=kind, metadata=_UNDATED[kind], dpi=dpi or PAGE["savefig.dpi"])
        unfinished.replace(file)
        files.append(file)
    return tuple(files)
