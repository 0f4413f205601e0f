"""Render a snapshot of a run: text for `gridpeers status`, a table for `gridpeers watch`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Group
from rich.table import Table
from rich.text import Text

from scenarios.live.show.snapshot import Line, Snapshot
from scenarios.short_names import short

EVENTS = 6
"""So many of the latest events are shown."""

OLD = 0.2
"""An age (s) from which on it is shown in colour: ten control periods of 20 ms, half of what is still used."""


@dataclass(frozen=True)
class _Column:
    head: str
    unit: str
    text: Callable[[Line], str]
    right: bool = True


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{round(value, digits) + 0.0:.{digits}f}"  # + 0.0: no -0.0


def _count(value: int | None) -> str:
    return "-" if value is None else str(value)


def _oldest(line: Line) -> str:
    return _number(max(line.ages.values(), default=None), 2)


_COLUMNS = (
    _Column("agent", "", lambda line: line.name, right=False),
    _Column("island", "", lambda line: line.island or "-", right=False),
    _Column("f", "Hz", lambda line: _number(line.f, 3)),
    _Column("P", "kW", lambda line: _number(line.P, 1)),
    _Column("P_set", "kW", lambda line: _number(line.P_set, 1)),
    _Column("P", "pu", lambda line: _number(line.P_share, 3)),
    _Column("Q", "kvar", lambda line: _number(line.Q, 1)),
    _Column("V", "pu", lambda line: _number(line.V, 4)),
    _Column("V_set", "pu", lambda line: _number(line.V_set, 4)),
    _Column("hears", "", lambda line: short(list(line.ages)), right=False),
    _Column("age", "s", _oldest),
    _Column("in", "", lambda line: _count(line.received)),
    _Column("out", "", lambda line: _count(line.sent)),
    _Column("lost", "", lambda line: _count(line.lost)),
    _Column("impaired", "", lambda line: short(line.impaired) if line.impaired else "", right=False),
    _Column("", "", lambda line: line.note, right=False),
)
"""What is shown of each agent; "age" is that of the oldest of what it heard from the neighbours that count, "impaired"
are those between whom and it an emulated fault holds."""


def _columns(snapshot: Snapshot) -> tuple[_Column, ...]:
    """The columns that there is something to show in."""
    calm = not any(line.impaired for line in snapshot.lines)
    return tuple(column for column in _COLUMNS if not (calm and column.head == "impaired"))


def head(snapshot: Snapshot) -> str:
    """One line on the whole run."""
    t = "has not begun" if snapshot.t is None else f"t = {snapshot.t:.2f} s"
    islands = list(dict.fromkeys(line.island for line in snapshot.lines if line.island))
    parts = [f"run {snapshot.run}", t, snapshot.pace, f"islands: {', '.join(islands)}" if islands else ""]
    parts.append(f"impaired to the plant: {short(snapshot.impaired)}" if snapshot.impaired else "")
    return "   ".join(part for part in parts if part)


def plain(snapshot: Snapshot) -> str:
    """Text for `gridpeers status`: no colour, no line drawing, columns that `awk` can cut.

    Parameters
    ----------
    snapshot : Snapshot
        What to show.
    """
    columns = _columns(snapshot)
    titles = [f"{column.head} {column.unit}".strip() for column in columns]
    rows = [titles, *([column.text(line) for column in columns] for line in snapshot.lines)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(columns))]
    text = [head(snapshot)]
    for row in rows if snapshot.lines else []:
        cells = [
            cell.rjust(width) if column.right else cell.ljust(width)
            for cell, width, column in zip(row, widths, columns, strict=True)
        ]
        text.append("  ".join(cells).rstrip())
    text += snapshot.events[-EVENTS:]
    return "\n".join(text) + "\n"


def table(snapshot: Snapshot, keys: str = "q: quit") -> Group:
    """Table for `gridpeers watch`.

    Parameters
    ----------
    snapshot : Snapshot
        What to show.
    keys : str, optional
        What can be typed.
    """
    grid = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    columns = _columns(snapshot)
    for column in columns:
        title = f"{column.head}\n{column.unit}" if column.head else ""
        grid.add_column(title, justify="right" if column.right else "left", no_wrap=column.head != "hears")
    for line in snapshot.lines:
        grid.add_row(*(Text(column.text(line), style=_style(column, line)) for column in columns))
    events = [Text(line, style="dim", no_wrap=True, overflow="ellipsis") for line in snapshot.events[-EVENTS:]]
    return Group(Text(head(snapshot), style="bold"), Text(), grid, Text(), *events, Text(keys, style="dim"))


def _style(column: _Column, line: Line) -> str:
    if line.note and not line.note.startswith("apart") and column.head in ("agent", ""):
        return "yellow"  # to be in another island is no fault
    if column.head == "age" and max(line.ages.values(), default=0.0) >= OLD:
        return "yellow"
    if (column.head == "lost" and line.lost) or column.head == "impaired":
        return "yellow"
    return ""
