"""Commands for people to type next, written as they called this one."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from pathlib import Path

PROGRAM = "gridpeers"


def command_line(*words: str, program: str = PROGRAM, within: Path | None = None) -> str:
    """Return a command as it can be typed in the terminal in which this one was.

    A program that was called by its path is not found by its name alone; so it keeps the path, as does another program
    that is installed beside it. From Python, where nothing was typed, it has its name. The command will be typed in the
    folder `within`, by default the present one.
    """
    return shlex.join([*_called(program, within), *words])


def _called(program: str, within: Path | None) -> list[str]:
    folder, separator, called = sys.argv[0].rpartition(os.sep)
    if called == "__main__.py" and Path(folder).name == PROGRAM:  # python -m gridpeers
        return [_typed(sys.orig_argv[0], within), "-m", program]
    beside = f"{folder}{separator}{program}"
    return [_typed(beside, within) if called == PROGRAM and Path(beside).is_file() else program]


def _typed(path: str, within: Path | None) -> str:
    """Return what to type for a program: its name where that leads to it, else its path."""
    folder, _, name = path.rpartition(os.sep)
    found = Path(shutil.which(name) or "")
    # folders are compared, as the program python of every virtual environment is a link to the same one
    if not folder or (found.is_absolute() and found.parent.resolve() == Path(folder).resolve()):
        return name
    if Path(path).is_absolute():
        return path
    path = os.path.relpath(path, within)
    return path if os.sep in path else f"{os.curdir}{os.sep}{path}"
