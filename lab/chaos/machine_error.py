"""The machine lacks what a run needs: a campaign ends there, for that is no failure of the scenario."""

from __future__ import annotations

import errno
import re
import tempfile
from collections.abc import Iterator

_ERRORS = (
    *(errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE),
    *(errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO, errno.ESTALE),
)
_NUMBER = f"(?:{'|'.join(map(str, _ERRORS))})"

_WORDS = re.compile(
    rf"MemoryError|\[Errno {_NUMBER}\]|os error {_NUMBER}\)|Os {{ code: {_NUMBER},|memory allocation of \d+ bytes"
    r"|failed to map segment from|can't start new thread|Zenoh cannot start its threads|may have \d+ files open at once"
    r"|was killed by SIGKILL"
)
"""Words of Python, Rust and the loader for a lack, in an error or in the last lines of a process that ended. In
simulated time a run sends SIGKILL to no process of its own before it has its verdict: a system without memory does."""


class MachineError(Exception):
    """The machine lacks what a run needs, as room on a disk; made from the line that tells of it."""

    def __init__(self, line: str) -> None:
        super().__init__(
            f"the machine lacks what a run needs ({line}); end other programs, do fewer runs at a time (--jobs), make "
            f"room in {tempfile.gettempdir()} or set TMPDIR to another folder, or raise the limit (ulimit)"
        )


def machine_error(*told: BaseException | str) -> MachineError | None:
    r"""Return the lack that errors of a run, or texts on its processes, laws and checks, name; None if they name none.

    Examples
    --------
    >>> str(machine_error("inv1 exited with status 1.\n  OSError: [Errno 24] Too many open files")).partition(";")[0]
    'the machine lacks what a run needs (OSError: [Errno 24] Too many open files)'
    >>> machine_error(FileNotFoundError(errno.ENOENT, "No such file", "mine.csv"))
    """
    for text in (text for it in told for text in ([it] if isinstance(it, str) else _texts(it))):
        if lines := [line for line in text.splitlines() if _WORDS.search(line)]:
            return MachineError(lines[-1].strip())  # an error ends its traceback
    return None


def _texts(error: BaseException | None) -> Iterator[str]:
    """Yield the text of an error, and of those that led to it, also where `raise ... from None` hides them."""
    while error is not None:
        yield f"{type(error).__name__}: {error}".rstrip(": ")
        error = error.__cause__ or error.__context__
