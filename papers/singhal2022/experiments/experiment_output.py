"""The output of an experiment: a page of panels with curves, and a table; both as plain data and as files.

Colours are Okabe and Ito's, which stay apart for colour-blind readers; markers differ too, so that curves can be told
in a black-and-white print. Later curves have smaller markers and shifted dashes: curves that coincide all stay visible.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

import gridpeers as gp
from gridpeers.measures import Floats
from gridpeers.output_folders import write_whole
from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES

Look = Literal["measured", "hollow", "predicted", "points", "trace", "solid", "reference"]
"""Measured: line and filled markers. Hollow: hollow markers, another way to measure. Predicted: a dashed line. Points:
filled markers without a line. Trace: a line over time with the dashes of its style; solid: one without. Reference: a
wide pale line, which is drawn first and stays visible below others."""


@dataclass(frozen=True)
class Curve:
    x: Floats
    y: Floats
    """An infinite value (never) is a mark at the upper edge."""
    style: int
    """Number of its colour and marker: one for the same case in all panels."""
    look: Look = "measured"
    low: Floats | None = None
    high: Floats | None = None
    """Range around it, if there is one."""


@dataclass(frozen=True, kw_only=True)
class PlotPanel:
    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    lines: Sequence[tuple[float, int]] = ()
    """Vertical lines at predicted limits: x, and the style of the curve that it belongs to."""
    spans: Sequence[tuple[float, float]] = ()
    """Shaded times (s), with a link or group cut."""
    level: float | None = None
    """A horizontal line, e.g. the band of the measure."""
    log: Literal["", "x", "y", "xy"] = ""
    x_ticks: Sequence[float] = ()
    x_names: Sequence[str] = ()
    """Names for 0, 1, 2, ... at the axis instead of numbers."""
    zero: float = 0.0
    """With a logarithmic x: between 0 and this value the axis is linear, so that 0 has a place."""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class PlotPage:
    title: str
    panels: Sequence[PlotPanel]
    columns: int
    names: Mapping[int, str]
    """Meaning of the styles, for the legend."""
    looks: Mapping[Look, str] = field(default_factory=lambda: {"measured": "measured", "predicted": "predicted"})
    """Meaning of the looks, for the legend."""
    share_y: bool = False
    height: float = 3.0
    """Height of a row of panels (inch)."""


def time_panels(
    cases: Sequence[Any], curves: Callable[[str, int, Any], Iterable[Curve]], suffix: str = "", **axes: Any
) -> list[PlotPanel]:
    """Return a panel for each of the two times after islanding, with `curves(index, style, case)` of each case."""
    return [
        PlotPanel(
            title=f"{title}{suffix}",
            y_label="time after islanding (s)",
            curves=[curve for style, case in enumerate(cases) for curve in curves(index, style, case)],
            **axes,
        )
        for index, (_, title) in INDEXES.items()
    ]


@dataclass(frozen=True)
class ExperimentResult:
    """A page, and the rows of its table by columns that end in their unit."""

    page: PlotPage
    rows: Sequence[Mapping[str, Any]]
    """Of texts and numbers; infinite or None for a time that never came."""
    apart: int = 0
    """Number of leading columns that split the table in Markdown: one table for each combination of their values."""

    def write(self, folder: Path, kind: gp.figures.Format = "png") -> tuple[Path, ...]:
        """Write the figure, table.csv and table.md into a folder; return the files."""
        files = folder / "table.csv", folder / "table.md"
        write_whole(files[0], self.as_csv())
        write_whole(files[1], self.markdown())
        return *gp.figures.save(draw(self.page), folder, "figure", (kind,), dpi=DPI), *files

    def as_csv(self) -> str:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.rows[0])
        writer.writerows([["never" if _is_never(cell) else cell for cell in row.values()] for row in self.rows])
        return text.getvalue()

    def markdown(self) -> str:
        columns = list(self.rows[0])[self.apart :]
        head = [f"| {' | '.join(columns)} |", "|" + "---|" * len(columns)]
        parts: dict[tuple[str, ...], list[str]] = {}
        for row in self.rows:
            texts = [_text(cell) for cell in row.values()]
            name = tuple(texts[: self.apart])
            parts.setdefault(name, [f"**{', '.join(name)}**", "", *head] if name else [*head])
            parts[name].append(f"| {' | '.join(texts[self.apart :])} |")
        return "\n".join("\n".join(part) + "\n" for part in parts.values())


def _is_never(cell: Any) -> bool:
    return cell is None or (isinstance(cell, float) and math.isinf(cell))


def _text(cell: Any) -> str:
    """Return a cell of a Markdown table, with three significant digits; CSV has all."""
    return "never" if _is_never(cell) else cell if isinstance(cell, str) else f"{cell:.3g}"


COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a7a7a", "#000000")
MARKERS = "osD^vPX*"
DASHES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (3, 1)), (0, (1, 1)), "-")
"""Of traces over time, which have no markers."""

SLANTED = 12  # Most names at an axis that are drawn slanted; more are drawn upright
DPI = 130  # Points per inch: readable in print, and small enough for a repository


def draw(page: PlotPage) -> Figure:
    """Draw a page."""
    with mpl.rc_context(gp.figures.PAGE):
        rows = -(-len(page.panels) // page.columns)
        width = {1: 6.4, 2: 8.4}.get(page.columns, 3.1 * page.columns)
        figure = Figure(figsize=(width, page.height * rows + 0.8), layout="constrained")
        grid = figure.subplots(rows, page.columns, squeeze=False, sharey="row" if page.share_y else "none")
        for axes, panel in zip(grid.flat, page.panels, strict=False):
            _draw(axes, panel)
        for axes in grid.flat[len(page.panels) :]:
            axes.set_visible(False)
        if handles := _legend(page):
            longest = max(len(str(handle.get_label())) for handle in handles)
            columns = max(1, min(len(handles), int(15 * width / (longest + 6))))
            figure.legend(handles=handles, loc="outside lower center", ncols=columns)
        figure.suptitle(page.title, fontsize=10)
    return figure


def _draw(axes: Axes, panel: PlotPanel) -> None:
    """Draw one panel: scales first, as times that never came are put at the edge."""
    for start, end in panel.spans:
        axes.axvspan(start, end, color="#eeeeee", zorder=0)
    if panel.level is not None:
        axes.axhline(panel.level, color="#000000", linewidth=0.6, zorder=1)
    for x, style in panel.lines:
        axes.axvline(x, color=COLOURS[style], linewidth=1.4, linestyle=(3 * style, (4, 2)), zorder=1)
    if "x" in panel.log:
        axes.set_xscale("symlog" if panel.zero else "log", **({"linthresh": panel.zero} if panel.zero else {}))
    if "y" in panel.log:
        axes.set_yscale("log")
    for curve in panel.curves:
        _plot(axes, curve)
    if panel.x_ticks:
        axes.set_xticks(panel.x_ticks, [f"{x:g}" for x in panel.x_ticks])
        axes.minorticks_off()
    if panel.x_names:
        lean: dict[str, Any] = {"rotation": 35, "ha": "right"} if len(panel.x_names) <= SLANTED else {"rotation": 90}
        axes.set_xticks(range(len(panel.x_names)), panel.x_names, fontsize=7.5, **lean)
    if panel.x_range:
        axes.set_xlim(*panel.x_range)
    if panel.y_range:
        axes.set_ylim(*panel.y_range)
    elif "y" not in panel.log and all((curve.y >= 0.0).all() for curve in panel.curves):
        axes.set_ylim(bottom=0.0)
    _never(axes, panel)
    low, high = axes.get_ylim()
    if "y" not in panel.log:
        axes.ticklabel_format(axis="y", useOffset=False)
    elif high < 1e3 * low:  # decades alone would be too few
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_locator(NullLocator())
    axes.set_title(panel.title, loc="left", pad=8)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)


def _plot(axes: Axes, curve: Curve) -> None:
    colour, marker = COLOURS[curve.style % len(COLOURS)], MARKERS[curve.style % len(MARKERS)]
    if curve.low is not None and curve.high is not None:
        axes.fill_between(curve.x, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
    smaller = 1.0 - 0.15 * min(curve.style, 3)
    looks: dict[Look, dict[str, Any]] = {
        "measured": {"ls": "-", "marker": marker, "ms": 7.0 * smaller, "lw": 2.4 * smaller},
        "hollow": {"marker": marker, "ms": 9.0, "mfc": "none", "lw": 0},
        "predicted": {"lw": 1.6, "ls": (2.3 * curve.style, (3, 1.6))},
        "points": {"marker": marker, "ms": 4, "lw": 0, "alpha": 0.75},
        "trace": {"ls": DASHES[curve.style % len(DASHES)], "lw": 1.5},
        "solid": {"ls": "-", "lw": 1.5},
        "reference": {"ls": "-", "lw": 4.0, "alpha": 0.6},
    }
    axes.plot(curve.x, np.where(np.isfinite(curve.y), curve.y, np.nan), color=colour, **looks[curve.look])


def _never(axes: Axes, panel: PlotPanel) -> None:
    """Put a sign of infinity at the upper edge for times that never came."""
    curves = [curve for curve in panel.curves if np.isposinf(curve.y).any()]
    for curve in curves:
        at = curve.x[np.isposinf(curve.y)]
        sign: dict[str, Any] = {"marker": r"$\infty$", "color": COLOURS[curve.style], "ms": 9, "lw": 0}
        axes.plot(at, np.full(len(at), 0.96), transform=axes.get_xaxis_transform(), **sign)
    if curves:
        note: dict[str, Any] = {"xycoords": "axes fraction", "xytext": (0, 2), "textcoords": "offset points"}
        axes.annotate(r"$\infty$: not within the run", (1.0, 1.0), ha="right", fontsize=7, color="#444444", **note)


def _legend(page: PlotPage) -> list[Line2D]:
    """Return an entry for each style, and one for filled, hollow and dashed, as far as the page has them."""
    curves = [curve for panel in page.panels for curve in panel.curves]
    used = {curve.look for curve in curves}
    wide = {curve.style for curve in curves if curve.look == "reference"}
    found = []
    for i, name in page.names.items():
        look: dict[str, Any] = {"marker": MARKERS[i], "lw": 0, "ms": 5}
        if used & {"trace", "solid"}:
            width, alpha = (4.0, 0.6) if i in wide else (1.6, 1.0)
            look = {"linestyle": DASHES[i] if "trace" in used else "-", "lw": width, "alpha": alpha}
        found.append(Line2D([], [], color=COLOURS[i], label=name, **look))
    shapes: dict[str, dict[str, Any]] = {
        "measured": {"marker": "o", "ms": 4.5, "lw": 1.2},
        "points": {"marker": "o", "ms": 4, "lw": 0},
        "hollow": {"marker": "o", "mfc": "none", "ms": 6.5, "lw": 0},
        "predicted": {"linestyle": "--", "lw": 1.6},
    }
    words = [(shapes[look], text) for look, text in page.looks.items() if look in used]
    if any(panel.lines for panel in page.panels):
        words.append(({"linestyle": (0, (4, 2)), "lw": 1.4}, "predicted limit"))
    return [*found, *(Line2D([], [], color="#333333", label=text, **shape) for shape, text in words)]
