"""Plots of a sweep, chosen by the varied parameters.

One parameter: each index against it, median and range over all the rest (seeds, graphs). Two on a grid: a heat map of
the medians. More, or drawn at random: each parameter by itself, with a point per run. A time that never came counts as
later than all others, and its number is written down; other indexes of runs that broke are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from gridpeers.scenarios.results.plots.style import PAGE, STYLES, save
from gridpeers.scenarios.sweep.sweep_case import FATE
from gridpeers.scenarios.sweep.sweep_table import INDEXES, label_of

MOST_VALUES = 40  # A number with more values than this was drawn at random, and is grouped
BINS = 12  # Groups of equally many runs that a parameter drawn at random is cut into for its median

REPEATS = ("sample", "case", "seed", "graph.number", "graph.lambda_2", "graph.edges")
"""Columns that repeat a point of the sweep instead of being an axis of it; medians are taken over them."""


def is_number(column: pd.Series) -> bool:
    return bool(is_numeric_dtype(column) and not is_bool_dtype(column))


def is_drawn(column: pd.Series) -> bool:
    return is_number(column) and column.nunique() > MOST_VALUES


def figures_of(frame: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return the parameters of each figure: two numbers on a grid share a heat map, all others stand by themselves."""
    varied = [name for name in _until_fate(frame) if name not in REPEATS and frame[name].nunique() > 1]
    if len(varied) == 2 and all(is_number(frame[name]) and not is_drawn(frame[name]) for name in varied):
        return [tuple(varied)]
    return [(name,) for name in varied]


def indexes_of(frame: pd.DataFrame) -> dict[str, list[str]]:
    """Return the indexes of each window, without the powers of single inverters."""
    found: dict[str, list[str]] = {}
    for name in list(frame)[len(_until_fate(frame)) :]:
        window, _, index = name.rpartition(".")
        if window and not window.endswith(".p"):
            found.setdefault(window, []).append(index)
    return found


def _until_fate(frame: pd.DataFrame) -> list[str]:
    columns = list(frame)
    return columns[: columns.index(FATE[0])]


def values_of(frame: pd.DataFrame, column: str) -> pd.Series:
    """Return the values of an index: a time that never came is infinite, any other that is missing is not a number."""
    index = column.rpartition(".")[2]
    return frame[column].astype(float).fillna(np.inf if index.startswith("t_") else np.nan)


def spread_of(at: pd.Series, values: pd.Series) -> pd.DataFrame:
    """Return `low`, `median` and `high` of values by their parameter, and how many `never` came to be (infinite).

    A parameter that was drawn at random is cut into groups, each with its median as index.
    """
    by = at.to_numpy()
    if is_drawn(at):
        groups = np.array_split(np.argsort(by, kind="stable"), BINS)
        by = pd.Series({run: np.median(by[group]) for group in groups for run in group}).sort_index().to_numpy()
    came = values.where(np.isfinite(values))
    columns = pd.DataFrame({"low": came, "median": values, "high": came, "never": np.isinf(values)})
    grouped = columns.groupby(by, sort=is_number(at))
    return grouped.agg({"low": "min", "median": "median", "high": "max", "never": "sum"})


MOST_LETTERS = 24  # Letters of a value at an axis: a table of faults, as JSON, is longer than the figure
MOST_TICKS = 12  # Most values of a parameter that are written at an axis
_NEVER = "#b0b0b0"  # Colour of the hatching of a heat map where the median never came to be


def draw_all(frame: pd.DataFrame, folder: Path) -> tuple[Path, ...]:
    drawn = []
    with mpl.rc_context(PAGE):
        for window, axes in product(indexes_of(frame), figures_of(frame)):
            if len(axes) == 1:
                drawn.append(_save(curves(frame, window, *axes), folder, f"{window}_{axes[0]}"))
                continue
            x, y = axes
            for case in frame["case"].unique():
                drawn.append(_save(heat_maps(frame, window, x, y, case), folder, f"{window}_{x}_{y}_{case}"))
    return tuple(drawn)


def curves(frame: pd.DataFrame, window: str, x: str) -> Figure:
    indexes = indexes_of(frame)[window]
    figure, panels = _page(len(indexes))
    cases = list(frame.groupby("case", sort=False))
    for panel, index in zip(panels, indexes, strict=True):
        never = 0
        for number, (case, rows) in enumerate(cases):
            at, y = rows[x], values_of(rows, f"{window}.{index}")
            spread = spread_of(at, y)
            if is_number(frame[x]):
                _curve(panel, spread, case, number, at, y)
            else:
                _bars(panel, spread, case, number, list(frame[x].unique()))
            never += int(spread["never"].sum())
        if never:
            panel.set_title(f"never in {never} of {len(frame)} runs", loc="right", fontsize=7, pad=3)
        _name_axis(panel, frame[x])
        panel.set_ylabel(label_of(index))
        _frame(panel, index)
    if len(cases) > 1:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(cases))
    figure.suptitle(f"after {window}: median and range over all other parameters", fontsize=10)
    return figure


def _curve(panel: Axes, spread: pd.DataFrame, case: str, number: int, at: pd.Series, y: pd.Series) -> None:
    colour, dashes = STYLES[number % len(STYLES)]
    x, median = spread.index.to_numpy(), spread["median"].where(np.isfinite(spread["median"]))
    panel.fill_between(x, spread["low"], spread["high"], color=colour, alpha=0.18, linewidth=0)
    panel.plot(x, median, linestyle=dashes, color=colour, lw=1.8, marker="o", ms=3.5, label=f"case {case}")
    if is_drawn(at):
        shown = np.isfinite(y)
        panel.plot(at[shown], y[shown], ".", color=colour, ms=2.5, alpha=0.5)


def _bars(panel: Axes, spread: pd.DataFrame, case: str, number: int, order: Sequence[Any]) -> None:
    colour = STYLES[number % len(STYLES)][0]
    x = [order.index(value) + 0.12 * number for value in spread.index]
    panel.vlines(x, spread["low"], spread["high"], color=colour, alpha=0.5, lw=3)
    panel.plot(x, spread["median"].where(np.isfinite(spread["median"])), "o", color=colour, label=f"case {case}")
    panel.set_xticks(range(len(order)), [_short(value) for value in order], rotation=30, ha="right")


def heat_maps(frame: pd.DataFrame, window: str, x: str, y: str, case: str) -> Figure:
    indexes = indexes_of(frame)[window]
    figure, panels = _page(len(indexes))
    rows = frame[frame["case"] == case]
    for panel, index in zip(panels, indexes, strict=True):
        medians = values_of(rows, f"{window}.{index}").groupby([rows[y], rows[x]]).median().unstack()
        masked = np.ma.masked_invalid(medians.to_numpy())
        low, high = _colours(masked, index)
        edges = (np.arange(size + 1) for size in reversed(medians.shape))
        mesh = panel.pcolormesh(*edges, masked, cmap="cividis", vmin=low, vmax=high)
        panel.patch.set(hatch="////", edgecolor=_NEVER)
        figure.colorbar(mesh, ax=panel, label=label_of(index))
        for axis, at in ((panel.xaxis, medians.columns), (panel.yaxis, medians.index)):
            ticks = range(0, len(at), -(-len(at) // MOST_TICKS))
            axis.set_ticks([i + 0.5 for i in ticks], [_short(at[i]) for i in ticks])
            axis.set_label_text(label_of(str(at.name)))
        panel.tick_params(axis="x", rotation=45)
        panel.grid(visible=False)
    hatched = "; hatched: never, or broke, in half of the runs or more"
    figure.suptitle(f"after {window}, case {case}: medians over all other parameters{hatched}", fontsize=10)
    return figure


def _colours(medians: Any, index: str) -> tuple[float, float]:
    """Return the ends of the scale of colours, so far apart that rounding has one colour."""
    least = INDEXES[index].least if index in INDEXES else 0.0
    if not medians.count():
        return 0.0, least or 1.0
    low, high = float(medians.min()), float(medians.max())
    if high - low >= least:
        return low, high
    return max(0.0, low - 0.5 * least), max(0.0, low - 0.5 * least) + least


def _page(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(count, 3)
    rows = -(-count // columns)
    figure = Figure(figsize=(3.9 * columns, 2.9 * rows + 0.5), layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for panel in panels[count:]:
        panel.set_visible(False)
    return figure, panels[:count]


def _name_axis(panel: Axes, parameter: pd.Series) -> None:
    panel.set_xlabel(label_of(str(parameter.name)))
    if is_number(parameter):
        if parameter.min() > 0 and parameter.max() / parameter.min() > 30:
            panel.set_xscale("log")
        elif parameter.nunique() <= MOST_TICKS and parameter.dtype.kind == "i":
            panel.set_xticks(sorted(parameter.unique()))
        else:
            panel.xaxis.set_major_locator(MaxNLocator(5))  # more digits than whole numbers have do not fit else


def _frame(panel: Axes, index: str) -> None:
    """Let the axis of an index begin at 0, as ours are magnitudes, and be long enough that rounding is no structure.

    Metrics of somebody's own may be anything: a frequency, which 0 would flatten, or less than 0.
    """
    if index in INDEXES:
        panel.set_ylim(bottom=0.0, top=max(panel.get_ylim()[1], 1.05 * panel.dataLim.y1, INDEXES[index].least))
    else:
        panel.ticklabel_format(axis="y", useOffset=False)


def _short(value: Any) -> str:
    text = f"{value:.3g}" if isinstance(value, float) else str(value)
    return text if len(text) <= MOST_LETTERS else text[: MOST_LETTERS - 3] + "..."


def _save(figure: Figure, folder: Path, name: str) -> Path:
    (file,) = save(figure, folder, "".join(c if c.isalnum() or c in "._-" else "_" for c in name))
    return file
