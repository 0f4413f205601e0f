"""Figures of a run by their names, and as pictures in a notebook."""

from __future__ import annotations

import sys
from io import BytesIO
from typing import TYPE_CHECKING

from gridpeers.scenarios.results.plots.drawing import Drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw(drawing: Drawing, name: str) -> Figure:
    """Draw a figure of a run, as a picture if it is the value of a notebook's cell.

    Raises
    ------
    ValueError
        If the run has no figure of this name.
    """
    from gridpeers.scenarios.results.plots import run_figures  # imports matplotlib

    shown_in_notebooks()
    return run_figures.draw(drawing, name)


def shown_in_notebooks() -> None:
    """Have a notebook show a figure that is the value of a cell as a picture, also without pyplot."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if shell is None:
        return
    from matplotlib.figure import Figure

    formatter = shell.display_formatter.formatters["image/png"]
    if formatter.for_type(Figure) is None:  # whoever has chosen another format keeps it
        formatter.for_type(Figure, _png)


def _png(figure: Figure) -> bytes:
    file = BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()
