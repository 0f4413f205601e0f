"""Render a snapshot of a run: text for `gridpeers status`, a table for `gridpeers watch`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Group
from rich.table import Table
from rich.text import Text

from gridpeers.scenarios.live.show.snapshot import InverterStatus, Snapshot
from gridpeers.scenarios.short_names import short

EVENTS = 6
"""Number of the latest events in a view."""


@dataclass(frozen=True)
class _Column:
    head: str
    unit: str
    text: Callable[[InverterStatus], str]
    right: bool = True


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{round(value, digits) + 0.0:.{digits}f}"  # + 0.0: no -0.0


def _count(value: int | None) -> str:
    return "-" if value is None else str(value)


def _oldest(inverter: InverterStatus) -> str:
    return _number(max(inverter.ages.values(), default=None), 2)


_COLUMNS = (
    _Column("agent", "", lambda inverter: inverter.name, right=False),
    _Column("island", "", lambda inverter: inverter.island or "-", right=False),
    _Column("f", "Hz", lambda inverter: _number(inverter.f, 3)),
    _Column("P", "kW", lambda inverter: _number(inverter.P, 1)),
    _Column("P_set", "kW", lambda inverter: _number(inverter.P_set, 1)),
    _Column("P", "pu", lambda inverter: _number(inverter.P_share, 3)),
    _Column("Q", "kvar", lambda inverter: _number(inverter.Q, 1)),
    _Column("V", "pu", lambda inverter: _number(inverter.V, 4)),
    _Column("V_set", "pu", lambda inverter: _number(inverter.V_set, 4)),
    _Column("hears", "", lambda inverter: short(list(inverter.ages)), right=False),
    _Column("age", "s", _oldest),
    _Column("in", "", lambda inverter: _count(inverter.received)),
    _Column("out", "", lambda inverter: _count(inverter.sent)),
    _Column("lost", "", lambda inverter: _count(inverter.lost)),
    _Column("impaired", "", lambda inverter: short(inverter.impaired) if inverter.impaired else "", right=False),
    _Column("", "", lambda inverter: inverter.note, right=False),
)
"""Columns of each agent; "age" is that of the oldest state of the neighbours in use, "impaired" are the senders whose
links to it have an emulated fault."""


def _columns(snapshot: Snapshot) -> tuple[_Column, ...]:
    """Return the columns that have something to show."""
    calm = not any(inverter.impaired for inverter in snapshot.inverters)
    return tuple(column for column in _COLUMNS if not (calm and column.head == "impaired"))


def head(snapshot: Snapshot) -> str:
    """Return one line on the whole run."""
    t = "has not begun" if snapshot.t is None else f"t = {snapshot.t:.2f} s"
    islands = list(dict.fromkeys(inverter.island for inverter in snapshot.inverters if inverter.island))
    parts = [f"run {snapshot.run}", t, snapshot.pace, f"islands: {', '.join(islands)}" if islands else ""]
    parts.append(f"impaired to the plant: {short(snapshot.impaired)}" if snapshot.impaired else "")
    return "   ".join(part for part in parts if part)


def plain(snapshot: Snapshot) -> str:
    """Return the text for `gridpeers status`: no colour, no line drawing, columns that `awk` can cut."""
    columns = _columns(snapshot)
    titles = [f"{column.head} {column.unit}".strip() for column in columns]
    rows = [titles, *([column.text(inverter) for column in columns] for inverter in snapshot.inverters)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(columns))]
    text = [head(snapshot)]
    for row in rows if snapshot.inverters else []:
        cells = [
            cell.rjust(width) if column.right else cell.ljust(width)
            for cell, width, column in zip(row, widths, columns, strict=True)
        ]
        text.append("  ".join(cells).rstrip())
    text += snapshot.events[-EVENTS:]
    return "\n".join(text) + "\n"


def table(snapshot: Snapshot, keys: str = "q: quit") -> Group:
    """Return the table for `gridpeers watch`; `keys` says which keys can be typed."""
    grid = Table(box=None, padding=(0, 2, 0, 0), header_style="bold")
    columns = _columns(snapshot)
    for column in columns:
        title = f"{column.head}\n{column.unit}" if column.head else ""
        grid.add_column(title, justify="right" if column.right else "left", no_wrap=column.head != "hears")
    for inverter in snapshot.inverters:
        grid.add_row(*(Text(column.text(inverter), style=_style(column, inverter)) for column in columns))
    events = [Text(line, style="dim", no_wrap=True, overflow="ellipsis") for line in snapshot.events[-EVENTS:]]
    return Group(Text(head(snapshot), style="bold"), Text(), grid, Text(), *events, Text(keys, style="dim"))


def _style(column: _Column, inverter: InverterStatus) -> str:
    if inverter.note and not inverter.note.startswith("apart") and column.head in ("agent", ""):
        return "yellow"  # to be in another island is no fault
    if column.head == "age" and inverter.late:
        return "yellow"
    if (column.head == "lost" and inverter.lost) or column.head == "impaired":
        return "yellow"
    return ""
