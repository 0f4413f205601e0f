"""What of a feeder our GridLAB-D model cannot represent; without numpy, as the checks of a scenario ask for it."""

from __future__ import annotations

import re

from plant.equipment import Feeder

from .glm_network import F_NOM

GLM_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.-]*")
"""Names that GridLAB-D takes for an object."""


def unrepresentable(feeder: Feeder) -> list[str]:
    """Return a sentence for everything that the model cannot represent."""
    if feeder.elements or feeder.load_parts:
        return [
            f"{feeder.name} was imported: its elements are admittance matrices, which no object of GridLAB-D takes; "
            "a feeder of our own tables can be written"
        ]
    problems = []
    if feeder.source is None:
        problems.append(f"{feeder.name} has no source.csv; GridLAB-D needs a substation as its swing bus")
    if feeder.f_nom != F_NOM:
        problems.append(f"{feeder.name} has {feeder.f_nom:g} Hz; the model is written for {F_NOM:g} Hz")
    fixed = (
        {f"n{bus.name}" for bus in feeder.buses} | {f"l{line.name}" for line in feeder.lines} | {"islands", "ticker"}
    )
    own = [("inverter", row.name) for row in feeder.inverters]
    own += [("regulator", name) for name in dict.fromkeys(row.name for row in feeder.regulators)]
    for kind, name in own:
        if not GLM_NAME.fullmatch(name):
            problems.append(f'{kind} "{name}": GridLAB-D takes letters, digits, _ . and -, a letter first; rename it')
        if name in fixed or name in [other for at, other in own if at != kind]:
            problems.append(f'{kind} "{name}": another object of the model has that name; rename it')
    return problems
