"""A program in a process group of its own, which ends whole: with whoever started it too, however that ended."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Sequence

LEAVING = 1.0
"""Time (s) that a program has to end once its input has."""

_GUARD = 'read -r _; sleep "$1"; test -z "$2" || rm -rf -- "$2"; kill -KILL 0'
"""Leads the group. Its own input ends with the process that started it, also by SIGKILL; then it ends the group."""


class ProcessGroup:
    """A program with pipes to its standard input and output, and all that it starts itself.

    Parameters
    ----------
    command : Sequence[str]
        What to run.
    folder : str
        Where to run it; "" is here.
    litter : str, optional
        Folder that is removed if whoever started the program dies; else it is theirs to remove.

    Raises
    ------
    OSError
        If it cannot be started.
    """

    def __init__(self, command: Sequence[str], folder: str, litter: str = "") -> None:
        self._guard = subprocess.Popen(
            ["/bin/sh", "-c", _GUARD, "gridpeers-guard", f"{LEAVING:g}", litter],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            process_group=0,
        )
        try:
            self.program = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                cwd=folder or None,
                bufsize=0,
                process_group=self._guard.pid,
            )
        except BaseException:
            self._end_group()
            raise

    def end_input(self) -> None:
        """End the input of the program, by which it is asked to end."""
        assert self.program.stdin is not None
        with contextlib.suppress(OSError):
            self.program.stdin.close()

    def wait(self, seconds: float) -> int | None:
        """Wait for the program to end; return its exit code, None if it still runs."""
        try:
            return self.program.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> None:
        """End the program and all that it has started, at once."""
        self._end_group()
        self.program.wait()

    def _end_group(self) -> None:
        if self._guard.returncode is None:  # once it is reaped, its number may be another group's
            with contextlib.suppress(ProcessLookupError, PermissionError):  # macOS refuses a group that has ended
                os.killpg(self._guard.pid, signal.SIGKILL)
            self._guard.wait()
        assert self._guard.stdin is not None
        self._guard.stdin.close()
