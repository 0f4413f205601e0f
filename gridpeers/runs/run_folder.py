"""The folder of a run, which goes with its results if nobody has asked to keep it."""

from __future__ import annotations

import shutil
import weakref
from os import PathLike
from pathlib import Path
from typing import Any

from scenarios.results.run_files import FolderError, refusal
from wire.path_text import is_no_path


class RunFolder:
    """A run folder; a temporary one is removed when nobody holds a result of it any more.

    Parameters
    ----------
    path : Path
        The folder.
    temporary : bool
        Whether it is to be removed.
    """

    def __init__(self, path: Path, *, temporary: bool = False) -> None:
        self.path = path
        self._removal = weakref.finalize(self, shutil.rmtree, path, ignore_errors=True) if temporary else None

    def keep(self) -> None:
        """Leave a temporary folder where it is."""
        if self._removal is not None:
            self._removal.detach()


def as_folder(it: Any) -> Path:
    """Return the path of a folder that somebody has named.

    Raises
    ------
    FolderError
        If it is no path.
    """
    if not isinstance(it, str | PathLike) or not str(it) or is_no_path(str(it)):
        raise FolderError(f"needs the path of a folder, got {it!r:.60}")
    return Path(it)


def empty_folder(it: str | Path) -> Path:
    """Make a folder for results.

    Raises
    ------
    FolderError
        If there is something in it, or it cannot be made.
    """
    folder = as_folder(it)
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            kind = "is not empty" if folder.is_dir() else "is a file"
            raise FolderError(f"{folder}: this {kind}; give a new or an empty folder")
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FolderError(refusal(folder, error)) from error
    return folder.absolute()  # whoever reads the results may have gone elsewhere meanwhile
