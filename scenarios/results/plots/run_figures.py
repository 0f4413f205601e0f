"""The figures of a run, as PNG files: those of all experiments, and those that belong to what happens in this one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from gridpeers.scenarios.results.plots.case_figures import MEASURES, overview, single
from gridpeers.scenarios.results.plots.drawing import Drawing
from gridpeers.scenarios.results.plots.inverter_figures import available_power, microgrids, plug_and_play, powers
from gridpeers.scenarios.results.plots.style import PAGE, save
from gridpeers.wire.wording import suggestion


def figures_of(drawing: Drawing) -> dict[str, Callable[[], Figure]]:
    figures: dict[str, Callable[[], Figure]] = {name: partial(single, drawing, name) for name in MEASURES}
    figures |= {
        "power_GFM": lambda: powers(drawing, GFM=True),
        "power_GFL": lambda: powers(drawing, GFM=False),
        "overview": lambda: overview(drawing),
    }
    if drawing.moves:
        figures["plug-n-play"] = lambda: plug_and_play(drawing)
    if drawing.limited:
        figures["available-power"] = lambda: available_power(drawing)
    figures |= {f"microgrids_{case}": partial(microgrids, drawing, case) for case in drawing.island_intervals}
    return figures


def draw(drawing: Drawing, name: str) -> Figure:
    """Draw one figure of a run in the style of all. Raise ValueError if the run has no figure of this name."""
    figures = figures_of(drawing)
    if name not in figures:
        raise ValueError(f'there is no figure "{name}" of this run; {suggestion(name, figures, "figures")}')
    with mpl.rc_context(PAGE):
        return figures[name]()


def draw_all(drawing: Drawing, folder: Path) -> tuple[Path, ...]:
    """Draw every figure of a run into a folder."""
    return draw_share(drawing, folder, 0, 1)


def draw_share(drawing: Drawing, folder: Path, number: int, of: int) -> tuple[Path, ...]:
    """Draw share `number`, counted from 0, of so many shares of a run's figures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    figures = figures_of(drawing)
    with mpl.rc_context(PAGE):
        return tuple(file for name in shares(figures, of)[number] for file in save(figures[name](), folder, name))


def shares(figures: Iterable[str], number: int) -> list[list[str]]:
    """Return so many shares of the figures that take about the same time to draw.

    Examples
    --------
    >>> shares(["frequency", "voltage", "MPSI", "MQSI", "overview"], 2)
    [['overview', 'MQSI'], ['frequency', 'voltage', 'MPSI']]
    """
    found: list[list[str]] = [[] for _ in range(number)]
    times = [0.0] * number
    for name in sorted(figures, key=lambda name: -_TIME.get(name, 1.0)):
        least = times.index(min(times))
        found[least].append(name)
        times[least] += _TIME.get(name, 1.0)
    return found


_TIME = {"overview": 2.5}
