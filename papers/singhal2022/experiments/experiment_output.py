"""The output of an experiment as plain data: a page of panels with curves, and a table; and both as files."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gridpeers.measures import Floats
from gridpeers.output_folders import write_whole
from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES

Look = Literal["measured", "hollow", "predicted", "points", "trace", "solid", "reference"]
"""Measured: line and filled markers. Hollow: hollow markers, another way to measure. Predicted: a dashed line. Points:
filled markers without a line. Trace: a line over time with the dashes of its style; solid: one without. Reference: a
wide pale line, which is drawn first and stays visible below others."""


@dataclass(frozen=True)
class Curve:
    """One curve of a panel."""

    x: Floats
    y: Floats
    """A time that never came is infinite: it is drawn as a sign at the upper edge."""
    style: int
    """Number of its colour and marker: one for the same case in all panels."""
    look: Look = "measured"
    low: Floats = field(default_factory=lambda: np.zeros(0))
    high: Floats = field(default_factory=lambda: np.zeros(0))
    """Range around it, if there is one."""


@dataclass(frozen=True, kw_only=True)
class LimitLine:
    """A vertical line at a predicted limit, in the style of the curve that it belongs to."""

    x: float
    style: int


@dataclass(frozen=True, kw_only=True)
class Panel:
    """One pair of axes."""

    title: str
    x_label: str
    y_label: str
    curves: Sequence[Curve]
    lines: Sequence[LimitLine] = ()
    spans: Sequence[tuple[float, float]] = ()
    """Times (s) in which something was down, shaded."""
    level: float | None = None
    """A horizontal line, e.g. the band of the measure."""
    log: Literal["", "x", "y", "xy"] = ""
    x_ticks: Sequence[float] = ()
    """Values at the axis; without, matplotlib's."""
    x_names: Sequence[str] = ()
    """Names for 0, 1, 2, ... at the axis instead of numbers."""
    zero: float = 0.0
    """With a logarithmic x: between 0 and this value the axis is linear, so that 0 has a place."""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Page:
    """A figure."""

    title: str
    panels: Sequence[Panel]
    columns: int
    """Panels side by side."""
    names: Mapping[int, str]
    """Meaning of the styles, for the legend."""
    looks: Mapping[Look, str] = field(default_factory=lambda: {"measured": "measured", "predicted": "predicted"})
    """Meaning of the looks, for the legend; those without words are left out."""
    share_y: bool = False
    height: float = 3.0
    """Height of a row of panels (inch)."""


def time_panels(curves: Callable[[int, str], Sequence[Curve]], suffix: str = "", **axes: Any) -> list[Panel]:
    """Return a panel for each of the two times after islanding; `curves` takes the number of the time and its name."""
    return [
        Panel(title=f"{title}{suffix}", y_label="time after islanding (s)", curves=curves(number, index), **axes)
        for number, (index, title) in enumerate(INDEXES)
    ]


FIGURE = "figure.png"


@dataclass(frozen=True, kw_only=True)
class ExperimentResult:
    """A figure and a table."""

    page: Page
    table: ExperimentTable

    def write(self, folder: Path) -> tuple[Path, ...]:
        """Write figure.png, table.csv and table.md into a folder; the files."""
        from gridpeers.papers.singhal2022.experiments import (
            experiment_plots as plots,  # matplotlib takes long to import; nothing else waits for it
        )

        self.table.write(folder)
        return plots.draw(self.page, folder / FIGURE), folder / "table.csv", folder / "table.md"


TableCell = str | float | None
"""A text, a number, or None for a time that never came."""


@dataclass(frozen=True, kw_only=True)
class ExperimentTable:
    """Rows under column names that end in their unit."""

    columns: Sequence[str]
    rows: Sequence[Sequence[TableCell]]
    digits: int = 3
    """Significant digits in Markdown; CSV has all."""
    apart: int = 0
    """Number of first columns whose values part it into tables of their own in Markdown."""

    def write(self, folder: Path) -> None:
        """Write table.csv and table.md into a folder."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([["never" if _is_never(cell) else cell for cell in row] for row in self.rows])
        write_whole(folder / "table.csv", text.getvalue())
        write_whole(folder / "table.md", self.markdown())

    def markdown(self) -> str:
        """Return the table as Markdown."""
        texts = [[self._text(cell) for cell in row] for row in self.rows]
        names = dict.fromkeys(tuple(row[: self.apart]) for row in texts)
        return "\n".join(
            self._one(name, [row[self.apart :] for row in texts if tuple(row[: self.apart]) == name]) for name in names
        )

    def _one(self, name: tuple[str, ...], rows: Sequence[Sequence[str]]) -> str:
        columns = self.columns[self.apart :]
        lines = [f"**{', '.join(name)}**", ""] if name else []
        lines += ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        lines += ["| " + " | ".join(row) + " |" for row in rows]
        return "\n".join(lines) + "\n"

    def _text(self, cell: TableCell) -> str:
        if _is_never(cell):
            return "never"
        return cell if isinstance(cell, str) else f"{cell:.{self.digits}g}"


def _is_never(cell: TableCell) -> bool:
    return cell is None or (isinstance(cell, float) and math.isinf(cell))
