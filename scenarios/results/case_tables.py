"""The tables of a case as files: history.csv, events.csv, links.csv; written in parts, as an hour has 800 MB."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from tempfile import SpooledTemporaryFile
from typing import TYPE_CHECKING

import msgspec

from gridpeers.netem.ledger import LinkTrace, copies_of
from gridpeers.scenarios.results.run_files import csv_text, write_whole
from gridpeers.wire.messages import PlantEvent

if TYPE_CHECKING:
    from gridpeers.scenarios.results.history import History

QUANTITIES = ("f_Hz", "P_W", "Q_var", "V_V", "P_set_W", "V_set_V")
"""Columns of each inverter, in the order of `gridpeers.wire.messages.Telemetry.rows`, with their units."""

EVENTS = ("t_s", "kind", "subject", "text")
LINKS = ("src", "dst", "seq", "t_s", "delay_s", "fate")
"""Columns of links.csv: one row for each copy of a message, or for a message that was dropped."""

_OTHER = re.compile(rb"[en]|[\[,-]0\.0000")  # Exponents, infinite and missing numbers, and those below 1e-4
_ROWS = 1000  # Rows of a history that are text at once
_SPOOL = 4_000_000  # Bytes of links.csv that are sorted in memory


def header(inverters: Iterable[str]) -> tuple[str, ...]:
    """Return the names of the columns of history.csv."""
    return ("t_s", *(f"{name}_{quantity}" for name in inverters for quantity in QUANTITIES))


def write_tables(
    folder: Path, history: History, events: Iterable[PlantEvent], traces: Iterable[LinkTrace] | None
) -> list[Path]:
    """Write the tables of a case, that of its links if there are `traces`; return their paths."""
    texts = {"history.csv": _history_csv(history), "events.csv": [csv_text([EVENTS, *event_rows(events)])]}
    if traces is not None:
        texts["links.csv"] = chain([csv_text([LINKS])], _by_link(traces, folder))
    for name, parts in texts.items():
        write_whole(folder / name, parts)
    return [folder / name for name in texts]


def _history_csv(history: History) -> Iterator[str]:
    yield ",".join(header(history.inverters)) + "\n"
    for first in range(0, len(history.t), _ROWS):
        rows = history.rows(slice(first, first + _ROWS)).table.tolist()
        yield "".join([_line(row) + "\n" for row in rows])


def _line(row: list[float]) -> str:
    """Return numbers as `repr` writes them: as JSON does, in a tenth of the time, but for the rare ones in `_OTHER`.

    >>> _line([0.1, -0.0, 2.5e-07, 1e22, float("nan")]), _line([60.00001, 0.0])
    ('0.1,-0.0,2.5e-07,1e+22,nan', '60.00001,0.0')
    """
    text = msgspec.json.encode(row)
    return ",".join(map(repr, row)) if _OTHER.search(text) else text[1:-1].decode()


def event_rows(events: Iterable[PlantEvent]) -> Iterator[tuple[float, str, str, str]]:
    return ((event.t, event.kind, event.subject, event.text) for event in events)


def link_rows(trace: LinkTrace) -> Iterator[tuple[str, str, int, float, float | str, str]]:
    """Yield the rows of a part of a link; the delay (s) of a message that was dropped is empty."""
    for seq, t, outcome in zip(trace.seq, trace.t, trace.outcome, strict=True):
        sent = trace.src, trace.dst, seq, t
        if isinstance(outcome, str):
            yield *sent, "", outcome
        for copy, (delay_s, bit) in enumerate(copies_of(outcome)):
            yield *sent, delay_s, ("copy" if copy else "passed") + ("" if bit is None else f", bit {bit} flipped")


def _by_link(traces: Iterable[LinkTrace], folder: Path) -> Iterator[str]:
    """Yield the text of the rows of each link, in the order of the links: so it is the same from run to run."""
    places: dict[tuple[str, str], list[tuple[int, int]]] = defaultdict(list)
    with SpooledTemporaryFile(max_size=_SPOOL, dir=str(folder)) as file:
        for trace in traces:
            text = csv_text(link_rows(trace)).encode()
            places[trace.src, trace.dst].append((file.tell(), len(text)))
            file.write(text)
        for _, parts in sorted(places.items()):
            for place, size in parts:
                file.seek(place)
                yield file.read(size).decode()
