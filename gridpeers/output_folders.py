"""Folders of results: new ones, how far they are, what made them; and those of feeders."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gridpeers.scenarios.results.run_files import RUNS as RUNS
from gridpeers.scenarios.results.run_files import FolderError as FolderError
from gridpeers.scenarios.results.run_files import empty_folder
from gridpeers.scenarios.results.run_files import new_folder as new_folder
from gridpeers.scenarios.results.run_files import refusal as refusal
from gridpeers.scenarios.results.run_files import set_broken as set_broken
from gridpeers.scenarios.results.run_files import set_status as set_status
from gridpeers.scenarios.results.run_files import shown as shown
from gridpeers.scenarios.results.run_files import write_whole as write_whole
from gridpeers.scenarios.versions import versions as versions
from gridpeers.wire.driver.ending import OutputLostError as OutputLostError


@contextmanager
def files_written(place: Path) -> Iterator[None]:
    """Write files within this; FolderError says which could not be written: `place` if the system does not say."""
    try:
        yield
    except OSError as error:
        raise FolderError(refusal(place, error)) from error


@contextmanager
def whole_folder(folder: Path) -> Iterator[None]:
    """Fill a folder, new or empty, within this; whatever ends it early leaves the folder as it was.

    FolderError if there is something in it, or it cannot be written.
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
