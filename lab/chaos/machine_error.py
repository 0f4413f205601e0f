"""The machine lacks what a run needs: a campaign ends there, for that is no failure of the scenario."""

from __future__ import annotations

import errno
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path

from gridpeers.plant.request_process import no_room as temporary_folder_is_full
from gridpeers.scenarios.results.run_files import no_room
from gridpeers.wire.driver.machine import too_few_files

_FAILING = (errno.EIO, errno.ESTALE)
"""Errors of a disk that fails."""

_DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, *_FAILING)

_DISK, _FILES, _KILLED, _MEMORY, _PROCESSES = "disk", "files", "killed", "memory", "processes"


def _numbers(*codes: int) -> str:
    """Return the pattern of errors of the system, as Python and Rust write them, the latter in a panic, too."""
    either = "|".join(map(str, codes))
    return rf"\[Errno (?:{either})\]|\(os error (?:{either})\)|Os \{{ code: (?:{either}),"


_WORDS = {
    _MEMORY: rf"MemoryError|{_numbers(errno.ENOMEM)}|memory allocation of \d+ bytes failed|failed to map segment from",
    _KILLED: "was killed by SIGKILL",
    _PROCESSES: rf"can't start new thread|Zenoh cannot start its threads|{_numbers(errno.EAGAIN)}",
    _FILES: rf"{_numbers(errno.EMFILE, errno.ENFILE)}|may have \d+ files open at once",
    _DISK: _numbers(*_DISK_ERRORS),
}
"""Words in the last lines, or in the report, of a process that ended for each kind of lack. In simulated time a run
sends SIGKILL to no process of its own before it has its verdict."""


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
    >>> print(machine_error(MemoryError(), Path("/tmp/run"), Path("/tmp")))
    a run has no memory (MemoryError); end other programs, do fewer runs at a time (--jobs), or raise the limit \
(ulimit -v)
    >>> machine_error(FileNotFoundError(errno.ENOENT, "No such file", "mine.csv"), Path("/tmp/run"), Path("/tmp"))
    """
    cause: BaseException | None = error
    while cause is not None:
        if too_many := too_few_files(cause):
            return MachineError(too_many)
        if isinstance(cause, MemoryError):
            return _lack(_MEMORY, f"MemoryError: {cause}".rstrip(": "), disk)
        if isinstance(cause, OSError):
            reason = cause.strerror or str(cause)
            if cause.errno == errno.ENOMEM:
                return _lack(_MEMORY, reason, disk)
            if cause.errno == errno.EAGAIN:
                return _lack(_PROCESSES, reason, disk)
            if no_room(cause) or cause.errno in _FAILING or _is_in(folder, cause):
                return unwritten(reason, disk)
        if lack := machine_lack([str(cause)], disk):
            return lack
        cause = cause.__cause__ or cause.__context__
    return None


def machine_lack(texts: Iterable[str], disk: Path | None = None) -> MachineError | None:
    r"""Return the error of the machine in what a run tells of its processes, laws and checks; None if there is none.

    Parameters
    ----------
    texts : Iterable[str]
        What it tells, such as how a process ended, with the last lines of its log.
    disk : Path, optional
        As for `machine_error`; the system's folder when left out.

    Examples
    --------
    >>> print(machine_lack(["inv1 exited with status 1.\n  OSError: [Errno 24] Too many open files"]))
    too many files are open (OSError: [Errno 24] Too many open files); raise the limit, e.g. with ulimit -n 4096
    >>> machine_lack(["inv1 exited with status 1.\n  KeyError: 'inv2'"])
    """
    for text in texts:
        for lack, words in _WORDS.items():
            if lines := [line for line in text.splitlines() if re.search(words, line)]:  # the error ends a traceback
                return _lack(lack, lines[-1].strip(), Path(tempfile.gettempdir()) if disk is None else disk)
    return None


def unwritten(reason: str, disk: Path) -> MachineError:
    """Return the error of a folder of temporary folders in which a run cannot write, for a reason."""
    return MachineError(temporary_folder_is_full("the files of a run", reason, disk))


def _lack(lack: str, reason: str, disk: Path) -> MachineError:
    """Return the error of a lack, for a reason."""
    if lack == _DISK:
        return unwritten(reason, disk)
    if lack == _FILES:
        return MachineError(f"too many files are open ({reason}); raise the limit, e.g. with ulimit -n 4096")
    fewer = "end other programs, do fewer runs at a time (--jobs), or raise the limit"
    if lack == _KILLED:
        killed = "a process of a run was killed from outside, as by a system without memory"
        return MachineError(f"{killed} ({reason}); {fewer} of memory")
    if lack == _MEMORY:
        return MachineError(f"a run has no memory ({reason}); {fewer} (ulimit -v)")
    return MachineError(f"a run can start no further process or thread ({reason}); {fewer} (ulimit -u, ulimit -v)")


def _is_in(folder: Path, error: OSError) -> bool:
    return isinstance(error.filename, str) and Path(error.filename).is_relative_to(folder)
