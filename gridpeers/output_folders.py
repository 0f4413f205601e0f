"""Folders of results: new ones, how far they are, what made them; and those of feeders."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from plant.tables.read import DATA, feeders
from scenarios.results.run_files import (
    RUNS,
    FolderError,
    new_folder,
    refusal,
    set_broken,
    set_status,
    shown,
    write_whole,
)
from scenarios.versions import versions
from wire.driver.output import OutputLostError
from wire.schema.suggestion import suggestion

__all__ = [
    "RUNS",
    "FolderError",
    "OutputLostError",
    "feeder_folder",
    "new_folder",
    "refusal",
    "set_broken",
    "set_status",
    "shown",
    "versions",
    "whole_folder",
    "write_whole",
]


@contextmanager
def whole_folder(folder: Path) -> Iterator[None]:
    """Fill a folder, new or empty, within this; whatever ends it early leaves the folder as it was."""
    there = folder.exists()
    try:
        yield
    except BaseException:  # an interruption, too
        for path in folder.iterdir() if folder.is_dir() else ():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        if folder.is_dir() and not there:
            folder.rmdir()
        raise


def feeder_folder(name: str) -> Path:
    """Return the folder with the tables of a feeder that comes with gridpeers, e.g. to copy and change them.

    Raises
    ------
    ValueError
        If there is none of this name.

    Examples
    --------
    >>> (feeder_folder("microgrid123") / "inverters.csv").is_file()
    True
    """
    if name not in feeders():
        raise ValueError(f'there is no feeder "{name}"; {suggestion(name, feeders(), "feeders")}')
    return DATA / name
