"""Read a feeder that is written for OpenDSS.

The engine parses the script and solves it once, so that its regulators and capacitor controls stand where they would.
Then every linear element comes over by its primitive admittance matrix, which holds lines of any geometry and
transformers of any connection; loads come over by the law of their `model`. What comes out is solved here, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from gridpeers.bridges.import_checks import SHOWN_NAMES, checked, number_of, refuse_if, with_plain_names
from gridpeers.bridges.opendss.dss_circuit import ImportRequest
from gridpeers.bridges.opendss.dss_process import circuit_of
from gridpeers.plant.equipment import Feeder
from gridpeers.wire.wording import first_of

UNGROUNDED = "ground a winding, or leave ppm_antifloat as it is"
"""Remedy where nothing determines a voltage to ground."""


def read_opendss(
    path: str | Path, f_nom: float | None = None, *, leave_out: Sequence[str] = (), switches: Sequence[str] = ()
) -> Feeder:
    """Return the feeder of a script for OpenDSS (`gridpeers.Feeder.from_opendss`).

    Its `notes` list what was done instead of what the script says.
    """
    path = Path(path).absolute()
    circuit = circuit_of(ImportRequest(str(path), f_nom, list(leave_out), list(switches)))
    feeder = checked(path, circuit.feeder, circuit.problems, UNGROUNDED)
    if not circuit.left_out:
        feeder = _compared(path, feeder, circuit.V)
    return with_plain_names(feeder, circuit.added)


def _compared(path: Path, feeder: Feeder, V: dict[tuple[str, str], complex]) -> Feeder:
    """Return the feeder with a note if our power flow has not the engine's voltages; refuse it if it has none."""
    from gridpeers.bridges.import_comparison import MATCH, difference, loads_without_ground

    solved = True
    try:
        worst, (bus, letter), two_solutions = difference(feeder, V)
        if worst <= MATCH:
            return feeder
        node = f"{bus}.{number_of(letter)}"
        told = f"{path.name}: our power flow differs from the engine's by {worst:.2g} pu, most at {node}"
        if two_solutions:
            told += "; both are solutions, as loads allow whose law jumps at Vminpu or Vmaxpu (models 3 and 4)"
    except ArithmeticError as error:
        solved, told = False, f"{path.name}: the engine solves it, our {error}"
    alone = loads_without_ground(feeder)
    if alone:
        told = (
            f"{first_of(alone, SHOWN_NAMES)}: constant power to ground behind a delta winding, where nothing else is "
            "grounded: the voltage to ground has no single solution; make it conn=delta or model=2, or ground a winding"
        )
    if alone or not solved:
        refuse_if(path, [told], feeder.places)
    return msgspec.structs.replace(feeder, notes=(*feeder.notes, told))
