"""Figures as files: PNG, PDF or SVG, whole or not at all, and the same bytes from run to run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.figure import Figure

from scenarios.results.plots.style import PAGE

Format = Literal["png", "pdf", "svg"]
"""Kind of file, as its name ends."""

_REPRODUCIBLE: Any = {"svg.hashsalt": "gridpeers", "svg.fonttype": "path", "pdf.fonttype": 42}
"""The salt stands in place of a random number from which an SVG's inner names are made. An SVG has letters as curves,
which look the same on every machine; a PDF has the font inside."""

_UNDATED: Mapping[Format, Mapping[str, Any]] = {
    "png": {},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
}
"""What leaves the time of writing out of a file."""


def save(
    figure: Figure, folder: Path, name: str, formats: Sequence[Format] = ("png",), dpi: float | None = None
) -> tuple[Path, ...]:
    """Write a figure into a folder, which is made where there is none.

    Parameters
    ----------
    figure : Figure
        What to write.
    folder : Path
        Where to.
    name : str
        Name of the file, without its ending.
    formats : Sequence of {"png", "pdf", "svg"}
        One file each.
    dpi : float, optional
        Resolution of a PNG (1/inch); that of all figures if left out.

    Returns
    -------
    tuple of Path
        The files.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for kind in formats:
        unfinished, file = folder / f".{name}.{kind}", folder / f"{name}.{kind}"
        with mpl.rc_context(PAGE | _REPRODUCIBLE), unfinished.open("wb") as stream:  # closed whatever goes wrong
            figure.savefig(stream, format=kind, metadata=dict(_UNDATED[kind]), dpi=dpi or PAGE["savefig.dpi"])
        unfinished.replace(file)
        files.append(file)
    return tuple(files)
