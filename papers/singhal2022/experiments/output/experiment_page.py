"""What an experiment draws, as plain data: panels of curves. `plots` turns it into a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from gridpeers.measures import Floats

Look = Literal["measured", "hollow", "predicted", "points", "trace", "solid", "reference"]
"""Measured: line and filled markers. Hollow: hollow markers, another way to measure. Predicted: a dashed line. Points:
filled markers without a line. Trace: a line over time with the dashes of its style; solid: one without. Reference: a
wide pale line, which is drawn first and stays visible below others."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """One curve of a panel."""

    x: Floats
    y: Floats
    """What never came to be is infinite: it is drawn as a sign at the upper edge."""
    style: int
    """Number of its colour and marker: what is alike in all panels has one."""
    look: Look = "measured"
    low: Floats = field(default_factory=lambda: np.zeros(0))
    high: Floats = field(default_factory=lambda: np.zeros(0))
    """Range around it, if there is one."""


@dataclass(frozen=True, kw_only=True)
class Line:
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
    lines: Sequence[Line] = ()
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
    """What the styles mean, for the legend."""
    looks: Mapping[Look, str] = field(default_factory=lambda: {"measured": "measured", "predicted": "predicted"})
    """What the looks mean, for the legend; those without words are left out."""
    share_y: bool = False
    height: float = 3.0
    """Height of a row of panels (inch)."""
