"""Equipment of a feeder that our GridLAB-D model cannot represent; without numpy, for the checks of a scenario."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from gridpeers.bridges.gridlabd.model.glm_inverters import node_of
from gridpeers.bridges.gridlabd.model.glm_network import F_NOM
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.inverter_parameters import GflParameters, GfmParameters, InverterParameters

GLM_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
"""Names that GridLAB-D takes for an object: a dot would begin the name of a property."""


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
    at: dict[str, list[str]] = {}
    for row in feeder.inverters:
        at.setdefault(row.bus, []).append(row.name)
    for bus, there in at.items():
        if len(there) > 1:
            text = (
                f'bus "{bus}" has {", ".join(there)}; GridLAB-D takes one inverter a bus: give each a bus behind a line'
            )
            problems.append(text)
    names = list(_names(feeder))
    taken = Counter(in_model for _, _, in_model in names)
    for kind, name, in_model in names:
        if not GLM_NAME.fullmatch(in_model):
            problems.append(f'{kind} "{name}": GridLAB-D takes letters, digits, _ and - for a name; rename it')
        elif taken[in_model] > 1:
            problems.append(f'{kind} "{name}": another object of the model has its name {in_model}; rename it')
    return problems


def beyond_gridlabd(own: InverterParameters) -> dict[str, str]:
    """Return, by their keys in a file, the values that no inverter of GridLAB-D has.

    Every other parameter is written by `glm_inverters`, or bounds set-points, which is done before GridLAB-D gets them.
    """
    found: dict[str, str] = {}
    if isinstance(own, GfmParameters):
        if own.model != "gridlabd":
            found["model"] = f'"{own.model}"'
        if not own.voltage_control:
            found["voltage_control"] = "false"
        if own.V_lim != GfmParameters().V_lim:  # fixed in GridLAB-D
            found["V_lim_pu"] = f"{own.V_lim:g}"
    else:
        if own.dead_band != "gridlabd":
            found["dead_band"] = f'"{own.dead_band}"'
        for key in ("Q_max", "Q_min"):  # GridLAB-D overwrites its own with what P leaves
            if getattr(own, key) != getattr(GflParameters(), key):
                found[f"{key}_pu"] = f"{getattr(own, key):g}"
    return found


def _names(feeder: Feeder) -> Iterator[tuple[str, str, str]]:
    """Yield what each object is, its name, and its name in the model (`glm_network`, `glm_inverters`)."""
    yield from (("bus", bus.name, f"n{bus.name}") for bus in feeder.buses)
    yield from (("line", line.name, f"l{line.name}") for line in feeder.lines)
    yield from (("kind of line", config.name, f"c{config.name}") for config in feeder.line_configs)
    yield from (("switch", switch.name, f"{initial}{switch.name}") for switch in feeder.switches for initial in "smz")
    yield from (("transformer", row.name, f"t{row.name}") for row in feeder.transformers)
    yield from (("transformer", row.name, f"ct{row.name}") for row in feeder.transformers)
    for name in dict.fromkeys(row.name for row in feeder.regulators):
        yield from (("regulator", name, in_model) for in_model in (name, f"c{name}", f"m{name}", f"z{name}"))
    yield from (("inverter", row.name, row.name) for row in feeder.inverters)
    single = [row for row in feeder.inverters if len(row.phases) == 1]
    yield from (("node of inverter", row.name, node_of(row.bus, row.phases)) for row in single)
    yield from (("object", name, name) for name in ("islands", "ticker", "minus_switch", "minus_regulator"))
