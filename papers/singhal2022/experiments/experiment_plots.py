"""A page of an experiment as a PNG file.

Colours are Okabe and Ito's, which stay apart for colour-blind readers; markers differ too, so that curves can be told
in a black-and-white print. Later curves have smaller markers and shifted dashes: curves that coincide all stay visible.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from gridpeers.figures import PAGE, save
from gridpeers.papers.singhal2022.experiments.experiment_output import Curve, Page, Panel

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a7a7a", "#000000")
MARKERS = "osD^vPX*"
DASHES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (3, 1)), (0, (1, 1)), "-")
"""Of traces over time, which have no markers."""


SLANTED = 12
"""Most names at an axis that slant; more of them stand upright."""

DPI = 130
"""Points per inch: readable in print, and small enough for a repository."""


def draw(page: Page, path: Path) -> Path:
    """Draw a page into a file, at once or not at all."""
    with mpl.rc_context(PAGE):
        rows = -(-len(page.panels) // page.columns)
        width = {1: 6.4, 2: 8.4}.get(page.columns, 3.1 * page.columns)
        figure = Figure(figsize=(width, page.height * rows + 0.8), layout="constrained")
        grid = figure.subplots(rows, page.columns, squeeze=False, sharey="row" if page.share_y else "none")
        for axes, panel in zip(grid.flat, page.panels, strict=False):
            _draw(axes, panel)
        for axes in grid.flat[len(page.panels) :]:
            axes.set_visible(False)
        handles = [*_names(page), *_looks(page)]
        if handles:
            labels = [str(handle.get_label()) for handle in handles]
            columns = max(1, min(len(labels), int(15 * width / (max(map(len, labels)) + 6))))
            figure.legend(handles, labels, loc="outside lower center", ncols=columns)
        figure.suptitle(page.title, fontsize=10)
        (file,) = save(figure, path.parent, path.stem, dpi=DPI)
    return file


def _draw(axes: Axes, panel: Panel) -> None:
    """Draw one panel: scales first, as times that never came are put at the edge."""
    for start, end in panel.spans:
        axes.axvspan(start, end, color="#eeeeee", zorder=0)
    if panel.level is not None:
        axes.axhline(panel.level, color="#000000", linewidth=0.6, zorder=1)
    for line in panel.lines:
        axes.axvline(line.x, color=COLOURS[line.style], linewidth=1.4, linestyle=(3 * line.style, (4, 2)), zorder=1)
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
    if "y" in panel.log and high < 1e3 * low:  # decades alone would be too few
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_locator(NullLocator())
    if "y" not in panel.log:
        axes.ticklabel_format(axis="y", useOffset=False)
    axes.set_title(panel.title, loc="left", pad=8)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)


def _plot(axes: Axes, curve: Curve) -> None:
    colour, marker = COLOURS[curve.style % len(COLOURS)], MARKERS[curve.style % len(MARKERS)]
    y = np.where(np.isfinite(curve.y), curve.y, np.nan)
    if curve.low.size:
        axes.fill_between(curve.x, curve.low, curve.high, color=colour, alpha=0.2, linewidth=0)
    match curve.look:
        case "measured":
            axes.plot(curve.x, y, "-", color=colour, marker=marker, ms=_nested(curve, 7.0), lw=_nested(curve, 2.4))
        case "hollow":
            axes.plot(curve.x, y, "", color=colour, marker=marker, ms=9.0, mfc="none", lw=0)
        case "predicted":
            axes.plot(curve.x, y, color=colour, lw=1.6, linestyle=(2.3 * curve.style, (3, 1.6)))
        case "points":
            axes.plot(curve.x, y, "", color=colour, marker=marker, ms=4, lw=0, alpha=0.75)
        case "trace":
            axes.plot(curve.x, y, linestyle=DASHES[curve.style % len(DASHES)], color=colour, lw=1.5)
        case "solid":
            axes.plot(curve.x, y, "-", color=colour, lw=1.5)
        case "reference":
            axes.plot(curve.x, y, "-", color=colour, lw=4.0, alpha=0.6)


def _nested(curve: Curve, largest: float) -> float:
    """Return the size of a marker, or width of a line: largest in style 0, 0.55 of it from style 3 on."""
    return largest * (1.0 - 0.15 * min(curve.style, 3))


def _never(axes: Axes, panel: Panel) -> None:
    """Put a sign of infinity at the upper edge for times that never came."""
    some = False
    for curve in panel.curves:
        never = np.isposinf(curve.y)
        if never.any():
            some = True
            at = np.full(int(never.sum()), 0.96)
            colour = COLOURS[curve.style % len(COLOURS)]
            axes.plot(
                curve.x[never], at, lw=0, marker=r"$\infty$", color=colour, ms=9, transform=axes.get_xaxis_transform()
            )
    if some:
        note: dict[str, Any] = {"xycoords": "axes fraction", "xytext": (0, 2), "textcoords": "offset points"}
        axes.annotate(r"$\infty$: not within the run", (1.0, 1.0), ha="right", fontsize=7, color="#444444", **note)


def _names(page: Page) -> list[Line2D]:
    used = {curve.look for panel in page.panels for curve in panel.curves}
    wide = {curve.style for panel in page.panels for curve in panel.curves if curve.look == "reference"}
    found = []
    for i, name in page.names.items():
        if used & {"trace", "solid"}:
            dashes: Any = DASHES[i] if "trace" in used else "-"
            width, alpha = (4.0, 0.6) if i in wide else (1.6, 1.0)
            found.append(Line2D([], [], color=COLOURS[i], linestyle=dashes, lw=width, alpha=alpha, label=name))
        else:
            found.append(Line2D([], [], color=COLOURS[i], marker=MARKERS[i], lw=0, ms=5, label=name))
    return found


def _looks(page: Page) -> list[Line2D]:
    """Return legend entries for filled, hollow and dashed, as far as the page has them."""
    used = {curve.look for panel in page.panels for curve in panel.curves}
    black = "#333333"
    shapes: dict[str, dict[str, Any]] = {
        "measured": {"marker": "o", "ms": 4.5, "lw": 1.2},
        "points": {"marker": "o", "ms": 4, "lw": 0},
        "hollow": {"marker": "o", "mfc": "none", "ms": 6.5, "lw": 0},
        "predicted": {"linestyle": "--", "lw": 1.6},
    }
    found = [
        Line2D([], [], color=black, label=words, **shapes[look]) for look, words in page.looks.items() if look in used
    ]
    if any(panel.lines for panel in page.panels):
        found.append(Line2D([], [], color=black, linestyle=(0, (4, 2)), lw=1.4, label="predicted limit"))
    return found
