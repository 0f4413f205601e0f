"""Plots of a sweep, chosen by what is varied.

One parameter: each index against it, median and range over all the rest (seeds, graphs). Two on a grid: a heat map of
the medians. More, or drawn at random: each parameter by itself, with a point per run. Where the axis is a text, its
values stand side by side. A case is a colour and a dash of Okabe and Ito's palette; heat maps are in cividis, made for
colour-blind readers. What never came to be (a time) counts as later than all others, and how often is written down;
other indexes of runs that broke are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from scenarios.results.history import Floats
from scenarios.results.plots import PAGE, case_style, save
from scenarios.sweep.column_labels import LEAST, WORDS, label_of
from scenarios.sweep.statistics import Choice, Spread, choose, spread_of, values

BINS = 12
"""Groups of equally many runs that a parameter drawn at random is cut into for its median."""

MOST_TICKS = 12
"""Most values of a parameter that are written at an axis."""

_NEVER = "#b0b0b0"
"""Colour of the hatching of a heat map where the median never came to be."""


def draw_all(table: pa.Table, folder: Path) -> tuple[Path, ...]:
    """Draw every figure of a sweep into a folder.

    Returns
    -------
    tuple of Path
        The files; none when no run reached its end, or nothing but seeds is varied.
    """
    choice = choose(table)
    drawn = []
    with mpl.rc_context(PAGE):
        for window in choice.indexes:
            if choice.map_of is not None:
                x, y = choice.map_of
                for case in choice.cases:
                    figure = heat_maps(choice, window, x, y, case)
                    drawn.append(_save(figure, folder, f"{window}_{x}_{y}_{case}"))
            for x in choice.alone:
                drawn.append(_save(curves(choice, window, x), folder, f"{window}_{x}"))
    return tuple(drawn)


def curves(choice: Choice, window: str, x: str) -> Figure:
    """Draw every index of a window against one parameter, a curve for each case."""
    figure, panels = _page(choice.indexes[window])
    for panel, index in zip(panels, choice.indexes[window], strict=True):
        never = []
        for number, case in enumerate(choice.cases):
            rows = choice.rows(case)
            at, y = rows[x], values(rows, f"{window}.{index}")
            spread = spread_of(at, y, BINS)
            if choice.is_number(x):
                _curve(panel, spread, case, number, at, y)
            else:
                _bars(panel, spread, case, number, list(dict.fromkeys(choice.columns[x])))
            never += [count for count in spread.never if count]
        if never:
            panel.set_title(f"never in {sum(never)} of {choice.runs} runs", loc="right", fontsize=7, pad=3)
        _name_axis(panel, choice, x)
        panel.set_ylabel(label_of(index))
        _frame(panel, index)
    _legend(figure, panels[0], choice)
    figure.suptitle(f"after {window}: median and range over all other parameters", fontsize=10)
    return figure


def _curve(panel: Axes, spread: Spread, case: str, number: int, at: Sequence[Any], y: Floats) -> None:
    """Median and range of one case over a number, with a point per run where the number was drawn."""
    colour, dashes = case_style(case, number)
    median = np.where(np.isfinite(spread.median), spread.median, np.nan)
    panel.fill_between(spread.x, spread.low, spread.high, color=colour, alpha=0.18, linewidth=0)
    panel.plot(spread.x, median, linestyle=dashes, color=colour, lw=1.8, marker="o", ms=3.5, label=f"case {case}")
    if spread.binned:
        shown = np.isfinite(y)
        panel.plot(np.asarray(at, float)[shown], y[shown], ".", color=colour, ms=2.5, alpha=0.5)


def _bars(panel: Axes, spread: Spread, case: str, number: int, order: Sequence[Any]) -> None:
    """Median and range of one case, for each text side by side."""
    colour = case_style(case, number)[0]
    x = [order.index(value) + 0.12 * number for value in spread.x]
    median = np.where(np.isfinite(spread.median), spread.median, np.nan)
    panel.vlines(x, spread.low, spread.high, color=colour, alpha=0.5, lw=3)
    panel.plot(x, median, "o", color=colour, label=f"case {case}")
    panel.set_xticks(range(len(order)), [str(value) for value in order], rotation=30, ha="right")


def heat_maps(choice: Choice, window: str, x: str, y: str, case: str) -> Figure:
    """Draw median of every index of a window over two parameters."""
    figure, panels = _page(choice.indexes[window])
    rows = choice.rows(case)
    xs, ys = (sorted(set(rows[name])) for name in (x, y))
    cells: dict[tuple[Any, Any], list[int]] = {}
    for number, at in enumerate(zip(rows[x], rows[y], strict=True)):
        cells.setdefault(at, []).append(number)
    for panel, index in zip(panels, choice.indexes[window], strict=True):
        z = values(rows, f"{window}.{index}")
        medians = np.full((len(ys), len(xs)), np.nan)
        for (i, b), (j, a) in product(enumerate(ys), enumerate(xs)):
            if here := cells.get((a, b)):
                medians[i, j] = spread_of([0] * len(here), z[here], BINS).median[0]
        masked = np.ma.masked_invalid(medians)
        low, high = _colours(masked, index)
        mesh = panel.pcolormesh(
            np.arange(len(xs) + 1), np.arange(len(ys) + 1), masked, cmap="cividis", vmin=low, vmax=high
        )
        panel.patch.set(hatch="////", edgecolor=_NEVER)
        figure.colorbar(mesh, ax=panel, label=label_of(index))
        for axis, positions, label in ((panel.xaxis, xs, x), (panel.yaxis, ys, y)):
            every = -(-len(positions) // MOST_TICKS)
            ticks = range(0, len(positions), every)
            axis.set_ticks([i + 0.5 for i in ticks], [_short(positions[i]) for i in ticks])
            axis.set_label_text(label_of(label))
        panel.tick_params(axis="x", rotation=45)
        panel.grid(visible=False)
    hatched = "; hatched: never, or broke, in half of the runs or more"
    figure.suptitle(f"after {window}, case {case}: medians over all other parameters{hatched}", fontsize=10)
    return figure


def _colours(medians: Any, index: str) -> tuple[float, float]:
    """Return the ends of the scale of colours: those of the values, but so far apart that rounding has one colour."""
    least = LEAST.get(index, 0.0)
    if not medians.count():
        return 0.0, least or 1.0
    low, high = float(medians.min()), float(medians.max())
    if high - low >= least:
        return low, high
    return max(0.0, low - 0.5 * least), max(0.0, low - 0.5 * least) + least


def _page(indexes: Sequence[str]) -> tuple[Figure, list[Axes]]:
    columns = min(len(indexes), 3)
    rows = -(-len(indexes) // columns)
    figure = Figure(figsize=(3.9 * columns, 2.9 * rows + 0.5), layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for panel in panels[len(indexes) :]:
        panel.set_visible(False)
    return figure, panels[: len(indexes)]


def _name_axis(panel: Axes, choice: Choice, x: str) -> None:
    panel.set_xlabel(label_of(x))
    numbers = choice.columns[x]
    if choice.is_number(x):
        if min(numbers) > 0 and max(numbers) / min(numbers) > 30:
            panel.set_xscale("log")
        elif len(set(numbers)) <= MOST_TICKS and all(isinstance(number, int) for number in numbers):
            panel.set_xticks(sorted(set(numbers)))
        else:
            panel.xaxis.set_major_locator(MaxNLocator(5))  # more digits than whole numbers have do not fit else


def _frame(panel: Axes, index: str) -> None:
    """Let the axis of an index begin at 0, as ours are magnitudes, and be long enough that rounding is no structure.

    Metrics of somebody's own may be anything: a frequency, which 0 would flatten, or less than 0.
    """
    if index not in WORDS and not index.startswith("p."):
        panel.ticklabel_format(axis="y", useOffset=False)
        return
    panel.set_ylim(bottom=0.0, top=max(panel.get_ylim()[1], 1.05 * panel.dataLim.y1, LEAST.get(index, 0.0)))


def _legend(figure: Figure, panel: Axes, choice: Choice) -> None:
    if len(choice.cases) > 1:
        handles, labels = panel.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _save(figure: Figure, folder: Path, name: str) -> Path:
    (file,) = save(figure, folder, "".join(c if c.isalnum() or c in "._-" else "_" for c in name))
    return file
