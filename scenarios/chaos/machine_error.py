"""The machine lacks what a run needs: a campaign ends there, for that is no failure of the scenario."""

from __future__ import annotations

import errno
from pathlib import Path

from plant.transient_folder import no_room as temporary_folder_is_full
from scenarios.results.run_files import no_room
from wire.driver.open_files import too_few_files

_FAILING = (errno.ENOMEM, errno.EIO, errno.ESTALE)
"""Errors of a machine without memory for a process, or with a disk that fails."""


class MachineError(Exception):
    """The machine lacks what a run needs, as room on a disk; the message says what, where, and what to do."""


def machine_error(error: BaseException, folder: Path, disk: Path) -> MachineError | None:
    """Return the error of the machine that is, or has led to, an error of a run; None if there is none.

    Parameters
    ----------
    error : BaseException
        The error.
    folder : Path
        Temporary folder of the run: nothing but the machine, or a person, removes or closes what is in it.
    disk : Path
        Folder of temporary folders, which the message names.

    Examples
    --------
    >>> print(machine_error(OSError(errno.ENOSPC, "No space left on device"), Path("/tmp/run"), Path("/tmp")))
    the files of a run cannot be written in /tmp (No space left on device); make room there, raise the limit of file \
sizes (ulimit -f), or set TMPDIR to another folder
    >>> machine_error(FileNotFoundError(errno.ENOENT, "No such file", "mine.csv"), Path("/tmp/run"), Path("/tmp"))
    """
    cause: BaseException | None = error
    while cause is not None:
        if too_many := too_few_files(cause):
            return MachineError(too_many)
        if isinstance(cause, OSError) and (no_room(cause) or cause.errno in _FAILING or _is_in(folder, cause)):
            return unwritten(cause.strerror or str(cause), disk)
        cause = cause.__cause__ or cause.__context__
    return None


def unwritten(reason: str, disk: Path) -> MachineError:
    """Return the error of a folder of temporary folders in which a run cannot write, for a reason."""
    return MachineError(temporary_folder_is_full("the files of a run", reason, disk))


def _is_in(folder: Path, error: OSError) -> bool:
    return isinstance(error.filename, str) and Path(error.filename).is_relative_to(folder)
