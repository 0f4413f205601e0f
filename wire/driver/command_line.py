"""Commands for people to type next, written as they called this one."""

from __future__ import annotations

import shlex
import shutil
import sys
from pathlib import Path

PROGRAM = "gridpeers"


def command_line(*words: str, program: str = PROGRAM) -> str:
    """Return a command as it can be typed in any folder: by its path if this one is not found by its name alone."""
    called = Path(sys.argv[0])
    if called.name == "__main__.py" and called.parent.name == PROGRAM:  # python -m gridpeers
        return shlex.join([sys.executable, "-m", program, *words])
    beside = called.absolute().with_name(program)
    found = shutil.which(program)
    here = called.name == PROGRAM and beside.is_file() and (found is None or Path(found).resolve() != beside.resolve())
    return shlex.join([str(beside) if here else program, *words])


def pip_install(extra: str) -> str:
    """Return the command that installs an extra: in a clone, or beside a wheel."""
    clone = (Path(__file__).parents[3] / "pyproject.toml").is_file()
    return f"pip install -e '.[{extra}]'" if clone else f"pip install 'gridpeers[{extra}]'"
