"""A table of the report as text, folded to a width: as many events as fit stand beside each other. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

GAP = 2
"""Spaces behind a column."""


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A table as text."""

    title: str
    header: tuple[str, ...]
    """The first column names the rows; the first line of each other one names its event."""
    rows: tuple[tuple[str, ...], ...]
    legend: str = ""
    """Lines below it; may be empty."""


def folded(grid: Grid, width: int) -> Iterator[Grid]:
    r"""Yield a table in parts that are at most so wide (characters), one below the other; no event is torn apart.

    Each part begins with the first column, has the rows that say something in it, and neither title nor legend. An
    event that is wider has a part of its own.

    Examples
    --------
    >>> grid = Grid(title="", header=("case", "a\nf", "a\nMPSI", "b\nf"), rows=(("I", "0.1", "0.2", "0.3"),))
    >>> [part.header for part in folded(grid, 22)]
    [('case', 'a\nf', 'a\nMPSI', 'b\nf')]
    >>> [part.header for part in folded(grid, 21)]
    [('case', 'a\nf', 'a\nMPSI'), ('case', 'b\nf')]
    """
    widths = [
        GAP + max(len(line) for cell in column for line in cell.split("\n"))
        for column in zip(grid.header, *grid.rows, strict=True)
    ]
    parts: list[list[int]] = []
    events: dict[str, list[int]] = {}
    for i, text in enumerate(grid.header[1:], 1):
        events.setdefault(text.partition("\n")[0], []).append(i)
    for columns in events.values():
        if parts and sum(widths[i] for i in (0, *parts[-1], *columns)) <= width:
            parts[-1] += columns
        else:
            parts.append(list(columns))
    for columns in parts:
        rows = [row for row in grid.rows if len(parts) == 1 or any(row[i] for i in columns)]
        yield replace(
            grid,
            title="",
            header=(grid.header[0], *(grid.header[i] for i in columns)),
            rows=tuple((row[0], *(row[i] for i in columns)) for row in rows),
            legend="",
        )
