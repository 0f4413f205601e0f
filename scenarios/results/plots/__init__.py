"""The figures of a run, as PNG files: those of all experiments, and those that belong to what happens in this one."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

from scenarios.results.drawing import Drawing
from scenarios.results.plots.available import available_power
from scenarios.results.plots.cases import MPSI, MQSI, frequency, overview, single, voltage
from scenarios.results.plots.inverters import plug_and_play, powers
from scenarios.results.plots.islands import microgrids
from scenarios.results.plots.style import CASE_STYLES, OTHER_STYLES, PAGE, case_style

__all__ = [
    "CASE_STYLES",
    "OTHER_STYLES",
    "PAGE",
    "Drawing",
    "available_power",
    "case_style",
    "draw_all",
    "microgrids",
    "overview",
    "plug_and_play",
]


def draw_all(drawing: Drawing, folder: Path) -> tuple[Path, ...]:
    """Draw every figure of a run into a folder.

    Returns
    -------
    tuple of Path
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(PAGE):
        figures = {
            "frequency.png": single(drawing, frequency),
            "MPSI.png": single(drawing, MPSI),
            "voltage.png": single(drawing, voltage),
            "MQSI.png": single(drawing, MQSI),
            "power_GFM.png": powers(drawing, GFM=True),
            "power_GFL.png": powers(drawing, GFM=False),
            "overview.png": overview(drawing),
        }
        if drawing.moves:
            figures["plug-n-play.png"] = plug_and_play(drawing)
        if drawing.limited:
            figures["available-power.png"] = available_power(drawing)
        if drawing.islands:
            figures |= {f"microgrids_{case}.png": microgrids(drawing, case) for case in drawing.histories}
        for name, figure in figures.items():
            partial = folder / f".{name}"
            figure.savefig(partial, format="png")
            partial.replace(folder / name)
    return tuple(folder / name for name in figures)
