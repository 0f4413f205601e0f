"""Folders of results: make them, set their status, and fill them as a whole or not at all."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gridpeers.scenarios.results.run_files import RUNS, FolderError, empty_folder, new_folder, refusal, set_broken
from gridpeers.scenarios.results.run_files import set_status as set_status
from gridpeers.scenarios.results.run_files import shown as shown
from gridpeers.scenarios.results.run_files import write_whole as write_whole
from gridpeers.scenarios.versions import versions as versions
from gridpeers.wire.driver.ending import OutputLostError as OutputLostError

__all__ = ["RUNS", "FolderError", "files_written", "new_folder", "refusal", "set_broken", "whole_folder"]


@contextmanager
def files_written(place: Path) -> Iterator[None]:
    """Turn an OSError of the block into a FolderError, which names the file, or `place` if the system names none."""
    try:
        yield
    except OSError as error:
        raise FolderError(refusal(place, error)) from error


@contextmanager
def whole_folder(folder: Path) -> Iterator[None]:
    """Fill a new or empty folder in the block; an early end of the block leaves the folder as it was.

    Raise FolderError if the folder is not empty, or cannot be written.
    """
    there = folder.exists()
    empty_folder(folder)
    try:
        with files_written(folder):
            yield
    except BaseException:  # an interruption, too
        for path in folder.iterdir() if folder.is_dir() else ():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        if folder.is_dir() and not there:
            folder.rmdir()
        raise
