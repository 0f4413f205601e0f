"""Figures of a sweep: each index of a window against one varied parameter, median and range over all the rest.

A time that never came counts as later than all others, and the number of such runs stands above; other indexes of runs
that broke are left out.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from gridpeers.scenarios.results.plots.style import PAGE, STYLES, save
from gridpeers.scenarios.sweep.sweep_case import FATE
from gridpeers.scenarios.sweep.sweep_table import unit_of

MOST_VALUES = 40  # A number with more values than this was drawn at random: a point per run, and no curve
MOST_LETTERS = 24  # Letters of a value at an axis: a table of faults, as JSON, is longer than the figure

REPEATS = ("sample", "case", "seed", "graph.number", "graph.lambda_2", "graph.edges")
"""Columns that repeat a point of the sweep instead of being an axis of it; medians are taken over them."""


def draw_all(frame: pd.DataFrame, folder: Path) -> tuple[Path, ...]:
    with mpl.rc_context(PAGE):
        return tuple(
            file
            for window, parameter in product(indexes_of(frame), varied(frame))
            for file in save(curves(frame, window, parameter), folder, _file_name(f"{window}_{parameter}"))
        )


def varied(frame: pd.DataFrame) -> list[str]:
    return [name for name in _until_fate(frame) if name not in REPEATS and frame[name].nunique() > 1]


def indexes_of(frame: pd.DataFrame) -> dict[str, list[str]]:
    """Return the indexes of each window, without the powers of single inverters."""
    found: dict[str, list[str]] = {}
    for name in list(frame)[len(_until_fate(frame)) :]:
        window, _, index = name.rpartition(".")
        if window and not window.endswith(".p"):
            found.setdefault(window, []).append(index)
    return found


def curves(frame: pd.DataFrame, window: str, parameter: str) -> Figure:
    indexes = indexes_of(frame)[window]
    columns = min(len(indexes), 3)
    rows = -(-len(indexes) // columns)
    figure = Figure(figsize=(3.9 * columns, 2.9 * rows + 0.5), layout="constrained")
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    is_number = is_numeric_dtype(frame[parameter]) and not is_bool_dtype(frame[parameter])
    order = sorted(frame[parameter].unique()) if is_number else list(frame[parameter].unique())
    for panel, index in zip(panels, indexes, strict=False):
        y = values_of(frame, f"{window}.{index}")
        for (case, of), (colour, dashes) in zip(frame.groupby("case", sort=False), STYLES * len(frame), strict=False):
            x = of[parameter] if is_number else of[parameter].map(order.index)
            if is_number and len(order) > MOST_VALUES:
                panel.plot(
                    x, y[of.index].where(np.isfinite(y[of.index])), ".", color=colour, ms=3, label=f"case {case}"
                )
                continue
            low, median, high = spread_of(x, y[of.index])
            panel.vlines(low.index, low, high, color=colour, alpha=0.4, lw=3)
            line = dashes if is_number else ""
            panel.plot(median.index, median, line, color=colour, marker="o", ms=3.5, label=f"case {case}")
        if never := int(np.isinf(y).sum()):
            panel.set_title(f"never in {never} of {len(frame)} runs", loc="right", fontsize=7, pad=3)
        panel.set_xlabel(_with_unit(parameter))
        panel.set_ylabel(_with_unit(index))
        panel.ticklabel_format(axis="y", useOffset=False)
        _set_ticks(panel, frame[parameter], None if is_number else order)
    for panel in panels[len(indexes) :]:
        panel.set_visible(False)
    if frame["case"].nunique() > 1:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=frame["case"].nunique())
    figure.suptitle(f"after {window}: median and range over all other parameters", fontsize=10)
    return figure


def values_of(frame: pd.DataFrame, column: str) -> pd.Series:
    """Return the values of an index: a time that never came is infinite, any other that is missing is not a number."""
    index = column.rpartition(".")[2]
    return frame[column].astype(float).fillna(np.inf if index.startswith("t_") else np.nan)


def spread_of(at: pd.Series, values: pd.Series) -> tuple[pd.Series, pd.Series, pd.Series]:
    """Return least, median and greatest of the values by their parameter; nan where they never came."""
    came, by = values.where(np.isfinite(values)), at.to_numpy()
    median = values.groupby(by).median()
    return came.groupby(by).min(), median.where(np.isfinite(median)), came.groupby(by).max()


def _until_fate(frame: pd.DataFrame) -> list[str]:
    columns = list(frame)
    return columns[: columns.index(FATE[0])]


def _with_unit(name: str) -> str:
    unit = unit_of(name)
    return f"{name} ({unit})" if unit else name


def _set_ticks(panel: Axes, parameter: pd.Series, texts: list[object] | None) -> None:
    if texts is not None:
        panel.set_xticks(range(len(texts)), [str(text)[:MOST_LETTERS] for text in texts], rotation=30, ha="right")
    elif parameter.min() > 0 and parameter.max() / parameter.min() > 30:
        panel.set_xscale("log")
    else:
        panel.xaxis.set_major_locator(MaxNLocator(5, integer=parameter.dtype.kind == "i"))


def _file_name(text: str) -> str:
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in text)
