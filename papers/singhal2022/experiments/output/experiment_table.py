"""The table of an experiment: as CSV for programs, as Markdown for people."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gridpeers.output_folders import write_whole

Cell = str | float | None
"""A text, a number, or None for a time that never came."""


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows under column names that end in their unit."""

    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    digits: int = 3
    """Significant digits in Markdown; CSV has all."""

    def write(self, folder: Path) -> None:
        """Write table.csv and table.md into a folder."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows([["never" if _is_never(cell) else cell for cell in row] for row in self.rows])
        write_whole(folder / "table.csv", text.getvalue())
        write_whole(folder / "table.md", self.markdown())

    def markdown(self) -> str:
        """The table as Markdown.

        Examples
        --------
        >>> print(Table(columns=("graph", "f (s)"), rows=(("full", 0.64123), ("path", None))).markdown(), end="")
        | graph | f (s) |
        |---|---|
        | full | 0.641 |
        | path | never |
        """
        lines = ["| " + " | ".join(self.columns) + " |", "|" + "---|" * len(self.columns)]
        lines += ["| " + " | ".join(self._text(cell) for cell in row) + " |" for row in self.rows]
        return "\n".join(lines) + "\n"

    def _text(self, cell: Cell) -> str:
        if _is_never(cell):
            return "never"
        return cell if isinstance(cell, str) else f"{cell:.{self.digits}g}"


def _is_never(cell: Cell) -> bool:
    return cell is None or (isinstance(cell, float) and math.isinf(cell))
