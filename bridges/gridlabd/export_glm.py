"""A feeder as a model that GridLAB-D runs by itself, without us."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

from gridpeers.bridges.gridlabd.glm import START, read_tables, write_glm
from gridpeers.bridges.gridlabd.glm_network import TableRow, network_blocks
from gridpeers.bridges.gridlabd.gridlabd_simulator import beyond_gridlabd, unrepresentable
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import FeederError
from gridpeers.plant.tables.write import TAP_STEP, write_feeder

POWER_FLOW_HEADER = f"""clock {{
	timezone UTC0;
	starttime '{START}';
	stoptime '{START[:-1]}1';
}}
module powerflow {{
	solver_method NR;
	line_capacitance true;
	line_limits false;
	default_maximum_voltage_error 1e-11;
}}"""
"""Head of the model of a feeder without inverters, whose power flow is solved once."""


def export_glm(feeder: Feeder, settings: PlantSettings, seconds: int, voltages: str) -> str:
    """Return a feeder as a GridLAB-D model: with inverters in delta mode, without any as a power flow.

    Each inverter begins with the power of our operating point; GridLAB-D finds the set-points that belong to it. The
    run lasts 1 to 50 `seconds`, and GridLAB-D writes the voltages of its start to the CSV file `voltages`. FeederError
    has all that the model cannot represent; without an operating point it is a RuntimeError.
    """
    problems = unrepresentable(feeder)
    for row in feeder.inverters:
        for key, value in beyond_gridlabd(feeder.parameters_of(row, settings.gfm, settings.gfl)).items():
            problems.append(f"{row.name} has {key} = {value}, which no {row.kind} of GridLAB-D has; leave it out")
    if problems:
        raise FeederError(feeder.name, tuple(problems))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_tables(feeder, folder)
        if feeder.inverters:
            parameters = {row.name: feeder.parameters_of(row, settings.gfm, settings.gfl) for row in feeder.inverters}
            plant = Plant(Network(feeder), settings, settings.h, settings.h)
            start = {name: complex(reading.P, reading.Q) for name, reading in plant.measure().items()}
            text = write_glm(folder, feeder.load_set, start, parameters, settings.h, seconds)
        else:
            V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
            text = "\n".join((POWER_FLOW_HEADER, *network_blocks(read_tables(folder), feeder.load_set, V_nom, ())))
    head = f"// {feeder.name}, load set {feeder.load_set}, by gridpeers. Bus 13 is node n13.\n"
    return f'{head}{text}\nobject voltdump {{\n\tfilename "{voltages}";\n\tmode RECT;\n}}\n'


def write_tables(feeder: Feeder, folder: Path) -> None:
    """Write the tables of a feeder, for `write_glm`.

    Regulators have whole taps: of the usual step, or one tap of a step of their own.
    """
    write_feeder(feeder, folder)
    if not feeder.regulators:
        return
    rows: list[TableRow] = []
    for each in feeder.regulators:
        tap, step = (each.ratio - 1.0) / TAP_STEP, TAP_STEP
        if abs(tap - round(tap)) > 1e-9 or abs(tap) > 16:
            tap, step = (1, each.ratio - 1.0) if each.ratio > 1.0 else (-1, 1.0 - each.ratio)
        ends = {"from_bus": each.from_bus, "to_bus": each.to_bus, "phases": each.phases}
        rows.append({"regulator": each.name, **ends, "tap": str(round(tap)), "tap_step_pu": repr(step)})
    steps = Counter(name for name, _ in {(row["regulator"], row["tap_step_pu"]) for row in rows})
    lines = [",".join(rows[0])]
    for row in rows:
        name = row["regulator"] if steps[row["regulator"]] == 1 else row["regulator"] + row["phases"]
        lines.append(",".join([name, *list(row.values())[1:]]))
    (folder / "regulators.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
