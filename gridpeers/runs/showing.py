"""Figures of a run by their names, and as pictures in a notebook."""

from __future__ import annotations

import sys
from io import BytesIO
from typing import TYPE_CHECKING

from scenarios.results.plots.drawing import Drawing
from wire.schema.suggestion import suggestion

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def drawn(drawing: Drawing, name: str) -> Figure:
    """Draw a figure of a run.

    Raises
    ------
    ValueError
        If the run has no figure of this name.
    """
    from scenarios.results.plots.run_figures import draw, figures_of

    shown_in_notebooks()
    names = figures_of(drawing)
    if name not in names:
        raise ValueError(f'there is no figure "{name}" of this run; {suggestion(name, names, "figures")}')
    return draw(drawing, name)


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
