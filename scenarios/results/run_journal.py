"""The journal of a study of many runs: a line for each run as it ends, so that the study goes on where it was ended.

A kill can cut the last line off before its line feed: that run counts as not done.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Protocol, TypeVar

import msgspec

from gridpeers.scenarios.results.run_files import FolderError, shown
from gridpeers.wire.codec import decode_foreign

JOURNAL = "runs.jsonl"


class JournalRow(Protocol):
    """The result of a run, as a struct of msgspec."""

    @property
    def number(self) -> int: ...


Row = TypeVar("Row", bound=JournalRow)


def journal_line(row: JournalRow) -> bytes:
    return msgspec.json.encode(row) + b"\n"


def rows_in(folder: Path, kind: type[Row], problem: Callable[[Row], str]) -> dict[int, Row]:
    """Return the runs in the journal of a folder, by their numbers; of two lines of one run the later one counts.

    `problem` says why the study has no such run, and what to do, as people edit journals; "" of a run that it has.

    Raise OSError if the journal cannot be read. Raise FolderError if a line is damaged, or the study has no such run.
    """
    rows, decoder = dict[int, Row](), msgspec.json.Decoder(kind)
    for place, line in enumerate((folder / JOURNAL).read_bytes().split(b"\n")[:-1], start=1):
        try:
            row = decode_foreign(decoder.decode, line)
            text = problem(row)
        except msgspec.DecodeError as error:
            text = f"this line is damaged ({error}); remove it, and its run is done again"
        if text:
            raise FolderError(f"{shown(folder / JOURNAL)}:{place}: {text}")
        rows[row.number] = row
    return rows


def open_journal(folder: Path) -> BinaryIO:
    """Open the journal of a folder, a new one if there is none, to add lines; the one that a kill cut off goes."""
    journal = (folder / JOURNAL).open("a+b")
    journal.seek(0)
    journal.truncate(journal.read().rfind(b"\n") + 1)
    return journal
