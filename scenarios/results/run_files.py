"""The run folder: its place, that it is empty and one command's, the state of its run, the journal of a study."""

from __future__ import annotations

import contextlib
import csv
import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from io import StringIO
from itertools import count
from pathlib import Path
from typing import BinaryIO, TypeVar

import msgspec

from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.driver.ending import OutputLostError
from gridpeers.wire.driver.machine import POSIX
from gridpeers.wire.wording import InputError

RUNS = Path("runs")  # Parent of the run folders that the user does not name, seen from the working directory
STATUS = "status.txt"  # File that says how far a folder's run is

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)  # The system takes no more bytes
_GONE = (errno.ENOENT, errno.ENOTDIR, errno.ESTALE, errno.EACCES, errno.EPERM)  # It was removed, or closed to us

_NOT_EMPTY = "the folder is not empty; give a new or an empty one"


class FolderError(InputError):
    """The output folder cannot be used."""


def new_folder(out: Path | None, scenario: str, now: datetime) -> Path:
    """Make the run folder: `out`, or `runs/<scenario>/<time>` with a link `runs/<scenario>/latest`.

    Raise FolderError if the folder has something in it, is a file, or cannot be made.
    """
    if out is not None:
        return empty_folder(out, "--out", "running")
    parent, stem = RUNS / scenario, now.strftime("%Y-%m-%dT%H-%M-%S")
    for number in count(1):  # further folders of the same second have a number too
        folder = parent / (stem if number == 1 else f"{stem}-{number}")
        try:
            empty_folder(folder, "--out", "running")
            break
        except FolderError:
            if not folder.is_dir():  # what is in the way is above
                raise
    latest, new = folder.parent / "latest", folder.parent / f".latest-{os.getpid()}"
    with contextlib.suppress(OSError):  # a file system without links goes without
        new.symlink_to(folder.name)
        new.replace(latest)
    return folder


def empty_folder(folder: Path, option: str = "", status: str = "") -> Path:
    """Make a folder for results, and return it; of two commands that take it at once for their status, one gets it.

    Raise FolderError, which names the option, if there is something in it, it is a file, or it cannot be made.
    """
    where = f"{option} {folder}".strip()
    try:
        _require_empty(folder, where)
        folder.mkdir(parents=True, exist_ok=True)
        if status:
            try:
                (folder / STATUS).touch(exist_ok=False)
            except FileExistsError:
                raise FolderError(f"{where}: {_NOT_EMPTY}") from None
            set_status(folder, status)
    except OSError as error:
        raise FolderError(_unmade(folder, error.strerror, option)) from None
    return folder


def _require_empty(folder: Path, where: str) -> None:
    if folder.exists() and not folder.is_dir():
        raise FolderError(f"{where}: this is a file; give a new or an empty folder")
    if folder.is_dir() and any(folder.iterdir()):
        raise FolderError(f"{where}: {_NOT_EMPTY}")


def _unmade(folder: Path, why: str | None, option: str) -> str:
    other = f"give another folder by {option}" if option else "give another folder"
    return f"{folder}: cannot be made or written: {why}; {other}"


def set_status(folder: Path, status: str) -> None:
    """Write the one line of status.txt: "running", "complete", or "broken: why"."""
    write_whole(folder / STATUS, status.replace("\n", " ") + "\n")


def set_complete(folder: Path) -> None:
    set_status(folder, "complete")


def is_complete(status: str) -> bool:
    return status.partition(":")[0] == "complete"  # older runs said what their record lacked


def set_broken(folder: Path, why: str) -> None:
    """Write "broken: why" to status.txt, on a full disk over its old text; it is no error if that fails too."""
    with contextlib.suppress(OSError):
        try:
            set_status(folder, f"broken: {why}")
        except OSError:
            with (folder / STATUS).open("r+", encoding="utf-8", errors="backslashreplace") as file:
                file.write("broken: " + why.replace("\n", " ") + "\n")
                file.truncate()


def no_room(error: BaseException) -> bool:
    return isinstance(error, OSError) and error.errno in _NO_ROOM


def refusal(folder: Path, error: OSError) -> str:
    """Return the file of a folder that could not be written, and the reason."""
    if no_room(error) or error.errno in _GONE:
        return f"{shown(Path(error.filename or folder))}: cannot be written: {error.strerror}"
    return str(error)


def write_whole(path: Path, content: str | bytes | Iterable[str]) -> None:
    """Write a file, from its text, pieces of it, or bytes, at once or not at all.

    A folder's name may have bytes that are no UTF-8; a text that names it has them as escapes, so that it is UTF-8.
    """
    partial = path.with_name(path.name + ".partial")
    try:
        if isinstance(content, bytes):
            partial.write_bytes(content)
        else:
            with partial.open("w", encoding="utf-8", errors="backslashreplace", newline="\n") as file:
                file.writelines([content] if isinstance(content, str) else content)
        partial.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        if error.filename in (None, str(partial)):
            error.filename = str(path)  # the file that the user asked for
        raise


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Return rows as CSV, whose lines end in a line feed on every system: equal runs give equal bytes."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def shown(folder: Path) -> str:
    with contextlib.suppress(ValueError):
        return str(folder.resolve().relative_to(Path.cwd().resolve()))
    return str(folder)


LOCK = ".lock"


def locked(folder: Path, option: str, command: str) -> int:
    """Lock a folder until this process ends; raise FolderError if another process has locked it."""
    handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    if not POSIX:
        return handle
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        text = f"{option} {shown(folder)}: another `gridpeers {command}` is at work in it; let it end"
        raise FolderError(text) from None
    return handle


class TerminatedError(KeyboardInterrupt):
    """Somebody ended the command by SIGTERM; it closes as after Ctrl-C."""


@contextmanager
def broken_if_ended(folder: Path) -> Iterator[None]:
    """Set the status of a run folder to "broken: why" if what is inside does not come to its end."""
    try:
        yield
    except KeyboardInterrupt as error:
        set_broken(folder, f"interrupted {'by SIGTERM' if isinstance(error, TerminatedError) else 'from the keyboard'}")
        raise
    except OSError as error:
        set_broken(folder, refusal(folder, error))
        raise
    except (Exception, OutputLostError) as error:
        set_broken(folder, str(error) or type(error).__name__)
        raise


JOURNAL = "runs.jsonl"


class JournalRow(msgspec.Struct, frozen=True, kw_only=True):
    """The result of a run of a study: a line of the journal, from which the study goes on."""

    number: int
    """Its place in the study, from 0."""


Row = TypeVar("Row", bound=JournalRow)


def journal_line(row: JournalRow) -> bytes:
    return msgspec.json.encode(row) + b"\n"


def rows_in(folder: Path, kind: type[Row], runs: int | None = None) -> dict[int, Row]:
    """Return the runs in the journal of a folder, by their numbers; of two lines of one run the later one counts.

    A last line that a kill cut off counts as not done. Raise FolderError if a line is damaged, or the study has not so
    many runs: people edit journals.
    """
    rows, decoder = dict[int, Row](), msgspec.json.Decoder(kind)
    for place, line in enumerate((folder / JOURNAL).read_bytes().split(b"\n")[:-1], start=1):
        where = f"{shown(folder / JOURNAL)}:{place}"
        try:
            row = decode_foreign(decoder.decode, line)
        except msgspec.DecodeError as error:
            text = f"{where}: this line is damaged ({error}); remove it, and its run is done again"
            raise FolderError(text) from None
        if runs is not None and row.number not in range(runs):
            raise FolderError(f"{where}: this study has runs 0 to {runs - 1}, none {row.number}; remove the line")
        rows[row.number] = row
    return rows


def open_journal(folder: Path) -> BinaryIO:
    """Open the journal of a folder, a new one if there is none, to add lines; the one that a kill cut off goes."""
    journal = (folder / JOURNAL).open("a+b")
    journal.seek(0)
    journal.truncate(journal.read().rfind(b"\n") + 1)
    return journal
