"""Read a feeder that is written for OpenDSS.

The engine parses the script and solves it once, so that its regulators and capacitor controls stand where they would.
Then every linear element comes over by its primitive admittance matrix, which holds lines of any geometry and
transformers of any connection; loads come over by the law of their `model`. What comes out is solved here, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from gridpeers.bridges.import_checks import MATCH, checked, difference, number_of, refuse_if, with_plain_names
from gridpeers.bridges.opendss.dss_circuit import ImportRequest
from gridpeers.bridges.opendss.dss_process import circuit_of
from gridpeers.plant.equipment import Feeder


def read_opendss(
    path: str | Path, f_nom: float | None = None, *, leave_out: Sequence[str] = (), switches: Sequence[str] = ()
) -> Feeder:
    """Return the feeder of a script for OpenDSS (`gridpeers.Feeder.from_opendss`).

    Its `notes` list what was done instead of what the script says.
    """
    path = Path(path).absolute()
    circuit = circuit_of(ImportRequest(str(path), f_nom, list(leave_out), list(switches)))
    feeder = checked(path, circuit.feeder, circuit.problems, "ground a winding, or leave ppm_antifloat as it is")
    if not circuit.left_out:
        try:
            worst, (bus, letter) = difference(feeder, circuit.V)
        except ArithmeticError as error:
            refuse_if(path, [f"{path.name}: the engine solves it, our {error}"])
        if worst > MATCH:
            where = f"most at {bus}.{number_of(letter)}"
            told = f"{path.name}: our power flow differs from the engine's by {worst:.2g} pu, {where}"
            feeder = msgspec.structs.replace(feeder, notes=(*feeder.notes, told))
    return with_plain_names(feeder, circuit.added)
