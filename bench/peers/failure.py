"""A measurement that failed, in one line; and commands whose failure tells the reason."""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Sequence

from bench.harness import GRIDPEERS

LONGEST = 300
"""Most characters of a reason."""

DEADLINE = 600.0
"""Longest time (s) for a command."""


def checked(command: Sequence[str], timeout: float = DEADLINE) -> str:
    """Run a command and return what it prints.

    Raises
    ------
    subprocess.CalledProcessError, subprocess.TimeoutExpired
        If it fails; `reason` makes a line of it.
    """
    done = subprocess.run(command, check=True, capture_output=True, text=True, errors="replace", timeout=timeout)
    return done.stdout


def reason(error: Exception) -> str:
    r"""Return what went wrong as one line: the command and its last line, or the first and the last line of the error.

    Examples
    --------
    >>> reason(subprocess.CalledProcessError(3, ["ls", "x y"], stderr="a\nno such file\n"))
    "`ls 'x y'` ended with 3: no such file"
    >>> reason(RuntimeError("inv1 died\nits log\nOSError: no room"))
    'inv1 died ... OSError: no room'
    """
    if isinstance(error, subprocess.CalledProcessError):
        last = _lines(error.stderr)[-1:] or ["it printed no error"]
        return f"`{_words(error.cmd)}` ended with {error.returncode}: {last[0]}"[:LONGEST]
    if isinstance(error, subprocess.TimeoutExpired):
        return f"`{_words(error.cmd)}` had not ended after {error.timeout:g} s"[:LONGEST]
    lines = _lines(str(error))
    if not lines:
        return type(error).__name__
    first = lines[0] if isinstance(error, RuntimeError) else f"{type(error).__name__}: {lines[0]}"
    return (first if len(lines) == 1 else f"{first} ... {lines[-1]}")[:LONGEST]


def _words(command: Sequence[str] | str) -> str:
    """Return a command as a person types it."""
    if isinstance(command, str):
        return command
    words = list(command)
    if tuple(words[: len(GRIDPEERS)]) == GRIDPEERS:
        words[: len(GRIDPEERS)] = ["gridpeers"]
    elif words[0] == sys.executable:
        words[0] = "python"
    return shlex.join(words)


def _lines(text: str | bytes | None) -> list[str]:
    if isinstance(text, bytes):
        text = text.decode(errors="replace")
    return [line.strip() for line in (text or "").splitlines() if line.strip()]
