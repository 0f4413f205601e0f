"""Read the folder of a run; a temporary one disappears with its results."""

from __future__ import annotations

import json
import re
import shutil
import weakref
from collections.abc import Callable
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from gridpeers.scenarios.record.record_info import FILE
from gridpeers.scenarios.results.run_files import FolderError, empty_folder
from gridpeers.wire.wording import is_no_path, printable

if TYPE_CHECKING:
    from gridpeers.scenarios.record.record_reader import RunRecord

T = TypeVar("T")


class RunFolder:
    """A run folder; a temporary one is removed with the last result of it."""

    def __init__(self, path: Path, *, temporary: bool = False) -> None:
        self.path = path
        self._records: dict[str, RunRecord] = {}
        self._removal = weakref.finalize(self, shutil.rmtree, path, ignore_errors=True) if temporary else None

    def keep(self) -> None:
        """Leave a temporary folder where it is."""
        if self._removal is not None:
            self._removal.detach()

    def read(self, name: str, reader: Callable[[Path], T]) -> T:
        """Read a file of the run, which may be removed or changed by now."""
        file = self.path / name
        try:
            return reader(file)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise FolderError(f"{file}: cannot be read: {printable(why, 200)}; run the scenario again") from error

    def record(self, case: str) -> RunRecord:
        """Return the record of a case, opened once."""
        from gridpeers.scenarios.record.record_reader import RunRecord  # mcap, which `import gridpeers` does without

        if case not in self._records:
            self._records[case] = RunRecord.open(self.path / case)
        return self._records[case]

    def recorded(self, case: str, read: Callable[[RunRecord], T]) -> T:
        """Read from the record of a case; a finished run has it whole."""

        def whole(_: Path) -> T:
            found = read(record := self.record(case))
            if record.damage:
                raise ValueError(record.damage[0])
            return found

        return self.read(f"{case}/{FILE}", whole)

    def numbers_of(self, case: str) -> dict[str, Any]:
        """Return the content of metrics.json on a case."""
        return self.numbers["cases"][case]  # type: ignore[no-any-return]

    @cached_property
    def numbers(self) -> dict[str, Any]:
        """The content of metrics.json."""
        numbers: dict[str, Any] = json.loads((self.path / "metrics.json").read_text(encoding="utf-8"))
        return numbers


def as_folder(it: Any) -> Path:
    """Return the path of a folder that somebody has named; FolderError if it can be none."""
    text = re.sub("[\udc80-\udcff]", "?", str(it))  # bytes of a name that is not UTF-8, as Python has them
    if not isinstance(it, str | PathLike) or not text or is_no_path(text):
        raise FolderError(f"needs the path of a folder, got {it!r:.60}")
    return Path(it)


def new_home(it: str | Path) -> Path:
    """Make a new or empty folder for results, and return its absolute path: the reader may change directories."""
    return empty_folder(as_folder(it)).absolute()
