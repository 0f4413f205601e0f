"""A law that is a functional mock-up unit for co-simulation, FMI 2 or 3, by the package fmpy (extra `fmu`).

Its variables are those of `gridpeers.agents.carriers.fmu_interface`. What is compiled cannot be interrupted, and may
take its process with it: so an FMU runs in one of its own, `gridpeers.agents.carriers.fmu_host`, to which the lines of
a law program go.
"""

from __future__ import annotations

import shutil
import sys
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

from msgspec.structs import replace

from gridpeers.agents.agent_config import LawChoice
from gridpeers.agents.carriers.program import ProgramLaw, ProgramReady
from gridpeers.agents.laws.call import LawError
from gridpeers.wire.printable import printable

LOADING = 10.0
"""Least time (s) that an FMU has to be loaded."""


class FmuLaw(ProgramLaw):
    """A law carried by an FMU.

    Parameters
    ----------
    choice : LawChoice
        Its path, parameters and folder.

    Raises
    ------
    ValueError
        If its process cannot be started.
    """

    def __init__(self, choice: LawChoice) -> None:
        path = (Path(choice.folder) / choice.fmu).absolute()
        try:
            self._unpacked = mkdtemp(prefix="gridpeers-fmu-")
        except OSError as error:
            raise ValueError(f"law {path.name}: there is nowhere to unpack it: {error.strerror}; set TMPDIR") from None
        command = (sys.executable, "-P", "-m", "gridpeers.agents.carriers.fmu_host", str(path), self._unpacked)
        try:
            super().__init__(replace(choice, command=command), path.name, self._unpacked)
        except ValueError:
            shutil.rmtree(self._unpacked, ignore_errors=True)
            raise
        self._patience = max(LOADING, self._patience)

    def load(self) -> None:
        """Wait until the FMU is loaded.

        Raises
        ------
        LawError
            If it cannot be.
        """
        self._ask({"type": "load"}, ProgramReady, 0.0)

    def close(self) -> None:
        """End its process, and remove what was unpacked."""
        super().close()
        shutil.rmtree(self._unpacked, ignore_errors=True)

    def _says(self, error: str, what: str) -> str:
        return printable(error, 300)


def load_problem(path: Path) -> str:
    """Return why an FMU cannot be loaded, "" if it can; the answer is kept as long as the file is the same."""
    about = path.stat()
    return _load_problem(str(path.absolute()), about.st_mtime_ns, about.st_size)


@lru_cache(maxsize=64)
def _load_problem(path: str, changed: int, size: int) -> str:
    try:
        law = FmuLaw(LawChoice(fmu=path))
    except ValueError as error:
        return str(error)
    try:
        law.load()
    except LawError as error:
        return f"law {Path(path).name} cannot be instantiated: {error}"
    finally:
        law.close()
    return ""
