"""A temporary folder that does not outlive its users, however they end."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

REMOVER = 'read _; rm -rf -- "$0"'
"""Program of the shell that waits for the end of its standard input."""


class TransientFolder:
    """A temporary folder that is removed when it is closed, or when all its users have ended, also by kill -9.

    A process that is killed can remove nothing. So a shell waits at a pipe until nobody holds its other end any more.

    Parameters
    ----------
    prefix
        Beginning of its name.
    """

    def __init__(self, prefix: str) -> None:
        self.path = Path(tempfile.mkdtemp(prefix=prefix))
        """Where it is."""
        end, self.user = os.pipe()
        """File descriptor; the folder stays while a process has inherited it and runs."""
        command = ["sh", "-c", REMOVER, str(self.path)]
        self._remover = subprocess.Popen(command, stdin=end, cwd="/", start_new_session=True)
        os.close(end)

    def close(self) -> None:
        """Remove the folder; all other users must have ended. A folder that is closed stays closed."""
        if self._remover.returncode is None:
            self._remover.kill()
            self._remover.wait()
            os.close(self.user)
            shutil.rmtree(self.path, ignore_errors=True)


def no_room(what: str, reason: str, folder: Path | None = None) -> str:
    """Return words for something that a process cannot write into a temporary folder; the system's when left out.

    Examples
    --------
    >>> no_room("the answer", "[Errno 28] No space left on device").replace(tempfile.gettempdir(), "/tmp")
    'the answer cannot be written in /tmp ([Errno 28] No space left on device); make room there, raise the limit of \
file sizes (ulimit -f), or set TMPDIR to another folder'
    """
    remedy = "make room there, raise the limit of file sizes (ulimit -f), or set TMPDIR to another folder"
    return f"{what} cannot be written in {folder or tempfile.gettempdir()} ({reason}); {remedy}"
