"""A folder of results that one command alone works in."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from gridpeers.scenarios.results.run_files import FolderError, shown

LOCK = ".lock"


def locked(folder: Path, option: str, command: str) -> int:
    """Lock a folder for this process; the system opens the lock however the process ends.

    Parameters
    ----------
    folder : Path
        The folder.
    option, command : str
        The option that names it, and the command, for the error.

    Returns
    -------
    int
        Descriptor whose closing opens the lock.

    Raises
    ------
    FolderError
        If another process has locked it.
    """
    handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise FolderError(
            f"{option} {shown(folder)}: another `gridpeers {command}` is at work in it; let it end"
        ) from None
    return handle
