"""What an experiment comes to: a figure and a table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from papers.singhal2022.experiments.output.experiment_page import Page
from papers.singhal2022.experiments.output.experiment_table import Table

FIGURE = "figure.png"


@dataclass(frozen=True, kw_only=True)
class Result:
    """A figure and a table."""

    page: Page
    table: Table

    def write(self, folder: Path) -> tuple[Path, ...]:
        """Write figure.png, table.csv and table.md into a folder; the files."""
        from papers.singhal2022.experiments.output import (
            experiment_plots as plots,  # matplotlib takes long to import; nothing else waits for it
        )

        self.table.write(folder)
        return plots.draw(self.page, folder / FIGURE), folder / "table.csv", folder / "table.md"
