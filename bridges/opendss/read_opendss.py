"""Read a feeder that is written for OpenDSS.

The engine parses the script and solves it once, so that its regulators and capacitor controls act.
Then every linear element is taken over by its primitive admittance matrix, which holds lines of any geometry and
transformers of any connection; loads are taken over by the law of their `model`. The feeder is then solved here, too.
"""

from __future__ import annotations

import atexit
import signal
from collections.abc import Sequence
from pathlib import Path

from gridpeers.bridges.engine_process import EngineError, EngineProcess
from gridpeers.bridges.feeder_import import FeederImport, file_of, number_of
from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import damaged, printable

ENGINE = EngineProcess("gridpeers.bridges.opendss.dss_circuit", "dss", "the OpenDSS engine", ".dss", "opendss")
atexit.register(ENGINE.close)

SHOWN = 100  # letters of a command that an error shows


def read_opendss(
    path: str | Path, f_nom: float | None = None, *, leave_out: Sequence[str] = (), switches: Sequence[str] = ()
) -> Tables:
    """Return the feeder of a script for OpenDSS (`gridpeers.Feeder.read`).

    Its `notes` list every departure from the script.
    """
    path = file_of(path)
    try:
        found: FeederImport = ENGINE.read(path, f_nom=f_nom, leave_out=list(leave_out), switches=list(switches))
    except EngineError as error:
        if not error.ended:
            raise
        text = crashed(str(error), error.at, path.name)
        raise FeederError(path.name, (text,)) from None
    remedy = "ground a winding, or leave ppm_antifloat as it is"
    return found.checked("the engine", remedy, number_of, strict=False)


def crashed(how: str, at: str, name: str) -> str:
    """Return one line on an engine that ended while it read a script, or while it loaded, where `at` is empty."""
    if not at:
        return damaged("dss", f"its process {how}", "the import of .dss files")
    where, _, command = printable(at).partition(": ")
    memory = ", as where memory runs out" if signal.SIGKILL.name in how else ""
    shown = command if len(command) <= SHOWN else f"{command[:SHOWN]}..."
    return (
        f"{where or name}: the OpenDSS engine itself crashes (its process {how}{memory}); change this command or "
        f"remove it; if it is correct, remove the commands before it, half by half, to find the cause: {shown}"
    )
