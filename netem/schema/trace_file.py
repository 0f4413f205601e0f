"""Reading measured delays from CSV files: the one part of the message layer that looks at files."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec

from gridpeers.netem.models.delay import DELAY, LONGEST_DELAY, Trace
from gridpeers.netem.schema.netem import Netem
from gridpeers.wire.schema.table_schema import Problem
from gridpeers.wire.text_file import TextFileError, read_table_text
from gridpeers.wire.wording import suggestion

COLUMN = "delay_s"  # Column that is read; others are free
MOST_ROWS = 20  # So many bad rows of a file are named; the others are counted


def read_delays(path: Path) -> tuple[tuple[float, ...], list[str]]:
    """Return the delays (s) of a CSV file with a column `delay_s`, one message a row, and its problems by row."""
    try:
        if not path.is_file():  # a device or a pipe may never end
            return (), [f'there is no file "{path}"; the path is relative to the scenario']
        return _rows(path.read_bytes(), path.name)
    except OSError as error:
        return (), [f"{path}: cannot be read: {error.strerror}"]
    except TextFileError as error:
        return (), [f"{path.name}: {error}"]


def _rows(data: bytes, file: str) -> tuple[tuple[float, ...], list[str]]:
    header, rows = read_table_text(data, [COLUMN], [COLUMN])
    if COLUMN not in header:
        return (), [f'{file}: no column "{COLUMN}" in its first line; {suggestion(COLUMN, header, "columns")}']
    column = header.index(COLUMN)
    delays, wrong = [], []
    for number, cells in rows:
        if len(cells) > len(header):
            wrong.append(f"{file} row {number}: {len(cells)} cells, but the header has {len(header)}")
            continue
        text = cells[column] if column < len(cells) else ""
        try:
            delay_s = float(text)
        except ValueError:
            wrong.append(f'{file} row {number}: {COLUMN} must be a number of seconds, got "{text}"')
            continue
        if text := DELAY.objection(delay_s, "s"):
            wrong.append(f"{file} row {number}: {text}")
        delays.append(delay_s)
    if wrong and len(wrong) == len(delays) and all(math.isfinite(d) and d > LONGEST_DELAY for d in delays):
        return (), [f"{file}: all {len(delays)} delays are above {LONGEST_DELAY:g} s; are they in milliseconds?"]
    if not delays and not wrong:
        wrong.append(f"{file}: no row under the header; a trace needs at least one delay")
    if len(wrong) > MOST_ROWS:
        wrong[MOST_ROWS:] = [f"{file}: {len(wrong) - MOST_ROWS} more rows like these"]
    return tuple(delays), wrong


def with_traces(netem: Netem, folder: Path) -> tuple[Netem, list[Problem]]:
    """Return the same with the delays of every trace, whose paths are relative to `folder`, and their problems."""
    found: list[Problem] = []
    faults = list(netem.links)
    for i, fault in enumerate(faults):
        delay = fault.delay
        if isinstance(delay, Trace) and delay.file and not delay.delays_s:
            delays_s, wrong = read_delays(folder / delay.file)
            found += [Problem(f"link[{i}].delay.file", text) for text in wrong]
            faults[i] = msgspec.structs.replace(fault, delay=msgspec.structs.replace(delay, delays_s=delays_s))
    return msgspec.structs.replace(netem, links=tuple(faults)), found
