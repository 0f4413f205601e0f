"""Style of all figures: one line style per case, the page, axes of time, reproducible files.

One colour and one dash pattern per case, the same in every figure, after Okabe and Ito's palette, which stays apart
for colour-blind readers; with the patterns the curves can be told in a black-and-white print too.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import inf
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gridpeers.scenarios.results.history import Floats
from gridpeers.scenarios.results.plots.drawing import Drawing

LineStyle = tuple[str, Any]

Style = tuple[str, Any, float]  # Colour, dash pattern and line width (pt)

CASE_STYLES: dict[str, LineStyle] = {
    "I": ("#7a7a7a", "-"),
    "II": ("#d55e00", "-"),
    "III": ("#009e73", "--"),
    "IV": ("#0072b2", "-"),
    "full": ("#0072b2", "-"),
    "untuned": ("#e69f00", "-"),
    "reduced": ("#d55e00", "-"),
    "adaptive": ("#000000", (0, (4, 2))),
    "link-failure": ("#56d6ae", (0, (2, 2))),
    "350kW": ("#0072b2", "-"),
    "275kW": ("#440154", "-"),
    "250kW": ("#31688e", "-"),
    "225kW": ("#21918c", "-"),
    "200kW": ("#8fbc3f", "-"),
    "175kW": ("#d55e00", ":"),
    "none": ("#d55e00", "-"),
    "clamp": ("#0072b2", "-"),
    "conditional": ("#000000", (0, (1, 3))),
}
"""Styles of the paper's cases. The full graph under full coordination is always blue. Less and less available power
goes from dark to light, after the palette viridis."""

TITLE_LENGTH = 48  # Characters of a panel's title that fit above half a page

OTHER_STYLES: tuple[LineStyle, ...] = (
    ("#0072b2", "-"),
    ("#d55e00", "-"),
    ("#009e73", "--"),
    ("#cc79a7", "-."),
    ("#e69f00", "-"),
    ("#56b4e9", "--"),
)
"""Styles of other cases, and of inverters, in turn."""

MOVER: Style = ("#d55e00", "-", 2.2)
"""Style of an inverter that leaves or joins, among all others."""

STAYERS: dict[bool, Style] = {True: ("#0072b2", "-", 1.6), False: ("#56b4e9", "--", 1.2)}
"""Styles of the others: grid-forming, or not."""

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


def case_style(case: str, number: int) -> LineStyle:
    """Return the style of a case: fixed for the paper's four, else in turn.

    Examples
    --------
    >>> case_style("IV", 0) == CASE_STYLES["IV"], case_style("ring", 1) == OTHER_STYLES[1]
    (True, True)
    """
    return CASE_STYLES.get(case, OTHER_STYLES[number % len(OTHER_STYLES)])


def case_styles(cases: Iterable[str]) -> dict[str, Style]:
    """Return the styles of cases that are drawn one on top of the other: where curves coincide, all of them are seen.

    Examples
    --------
    >>> [width for _, _, width in case_styles(["I", "II", "III", "IV"]).values()]
    [3.0, 2.5, 2.0, 1.5]

    A case of a fixed style takes its colour from the others:

    >>> len({colour for colour, _, _ in case_styles(["none", "ring", "star"]).values()})
    3
    """
    names = list(cases)
    taken = {CASE_STYLES[case][0] for case in names if case in CASE_STYLES}
    free = [style for style in OTHER_STYLES if style[0] not in taken] or list(OTHER_STYLES)
    others = [case for case in names if case not in CASE_STYLES]
    styles = CASE_STYLES | {case: free[k % len(free)] for k, case in enumerate(others)}
    return {case: (*styles[case], width) for case, width in zip(names, widths(len(names)), strict=True)}


def widths(count: int) -> list[float]:
    """Return the widths (pt) of curves that are drawn one on top of the other, the lowest first."""
    if count < 2:
        return [2.0] * count
    step = min(0.5, 1.8 / (count - 1))
    return [1.5 + step * above for above in reversed(range(count))]


class Bounds(NamedTuple):
    """End of an axis that starts at 0."""

    least: float = 0.05
    """There or above, so that what is next to nothing looks like it."""
    shown: float = 0.995
    """Part of all values that it has."""
    most: float = inf


SHARING = Bounds(most=5.0)
"""Of MPSI and MQSI, which have no bound where little is shared. The paper's go up to 2, ours after an event to 4."""

VOLTAGE = Bounds(least=0.01, shown=0.98)
"""Of V_error (pu), whose spikes at a switching are ten times what is left of it, and last longer."""


def from_zero(axes: Axes, curves: Iterable[Floats], bounds: Bounds) -> None:
    """Start the axis at 0, and let spikes of a few ms at a switching leave the frame instead of flattening the rest.

    A curve that settles beyond the frame is told.
    """
    finite = [curve[np.isfinite(curve)] for curve in curves]
    finite = [curve for curve in finite if curve.size]
    if not finite:
        return
    values = np.concatenate(finite)
    settled = max(float(np.median(curve[-max(curve.size // 10, 1) :])) for curve in finite)
    top = min(max(float(np.quantile(values, bounds.shown)) * 1.15, bounds.least), bounds.most)
    peak = float(values.max())
    axes.set_ylim(0.0, top)
    if peak > top:
        axes.annotate(
            f"one rests at {settled:.2g}" if settled > top else f"spikes reach {peak:.2g}",
            (0.995, 0.985),
            xycoords="axes fraction",
            ha="right",
            va="top",
            fontsize=7,
            color="#444444",
            bbox={"facecolor": "#ffffff", "edgecolor": "none", "pad": 1.0},
        )


def time_axis(axes: Axes, drawing: Drawing) -> None:
    axes.set_xlabel("time (s)")
    axes.set_xlim(0.0, max(float(history.t[-1]) for history in drawing.histories.values()))


def name_panel(axes: Axes, title: str, label: str) -> None:
    axes.set_title(title, loc="left")
    axes.set_ylabel(label)


def nominal_line(axes: Axes, value: float) -> None:
    """Draw a fine line at a nominal value, and write numbers near it in full."""
    axes.axhline(value, color="#000000", linewidth=0.6, zorder=1)
    axes.ticklabel_format(axis="y", useOffset=False)


def words(drawing: Drawing, case: str) -> str:
    title = drawing.titles.get(case, "")
    return f"{case}: {title}" if title else case


def case_title(drawing: Drawing, case: str) -> str:
    return "\n".join(wrap(f"Case {words(drawing, case)}", TITLE_LENGTH))


def columns(labels: Sequence[str], width: float) -> int:
    """Return how many columns of a legend fit below a figure of this width (inches), without a lonely last entry."""
    longest = max((len(label) for label in labels), default=1)
    fit = max(1, int(width / (0.058 * longest + 0.42)))
    rows = -(-len(labels) // fit)
    return -(-len(labels) // rows) if labels else 1


def legend_below(figure: Figure, axes: Axes, *, one_row: bool = False) -> None:
    handles, labels = axes.get_legend_handles_labels()
    ncols = max(len(labels), 1) if one_row else columns(labels, figure.get_figwidth())
    figure.legend(handles, labels, loc="outside lower center", ncols=ncols)


Format = Literal["png", "pdf", "svg"]  # Kind of file, as its name ends

_REPRODUCIBLE: Any = {"svg.hashsalt": "gridpeers", "svg.fonttype": "path", "pdf.fonttype": 42}
"""The salt stands in place of a random number from which an SVG's inner names are made. An SVG has letters as curves,
which look the same on every machine; a PDF has the font inside."""

_UNDATED: Mapping[Format, Mapping[str, Any]] = {
    "png": {},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}
"""Metadata that leave the time of writing out of a file."""


def save(
    figure: Figure, folder: Path, name: str, formats: Sequence[Format] = ("png",), dpi: float | None = None
) -> tuple[Path, ...]:
    """Write a figure into a folder, which is made where there is none."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for kind in formats:
        unfinished, file = folder / f".{name}.{kind}", folder / f"{name}.{kind}"
        with mpl.rc_context(PAGE | _REPRODUCIBLE), unfinished.open("wb") as stream:  # closed whatever goes wrong
            figure.savefig(stream, format=kind, metadata=dict(_UNDATED[kind]), dpi=dpi or PAGE["savefig.dpi"])
        unfinished.replace(file)
        files.append(file)
    return tuple(files)
