"""Write a feeder of `plant/data` as a GridLAB-D model (GLM).

This file and its two helpers read the tables by themselves and share no code with `gridpeers.plant.tables` and
`gridpeers.plant.network`, so that a problem there shows as a difference. Only the inverters' parameters come as
`gridpeers.plant.plant_config` has them.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from math import sqrt
from pathlib import Path

from gridpeers.bridges.gridlabd.model.glm_inverters import inverter_blocks, node_blocks
from gridpeers.bridges.gridlabd.model.glm_network import network_blocks
from gridpeers.plant.equipment.inverter_parameters import InverterParameters

START = "2000-01-01 00:00:00"
"""GridLAB-D's clock at the start; delta mode begins one second later."""


def write_glm(
    folder: Path,
    load_set: str,
    start: Mapping[str, complex],
    parameters: Mapping[str, InverterParameters],
    h: float,
    seconds: int,
) -> str:
    """Write a feeder with its inverters, spares left out.

    Parameters
    ----------
    folder
        Its tables; the layout is that of `plant/data/README.md`.
    load_set
        Which load table.
    start
        Power (VA) that each inverter delivers at the start.
    parameters
        Parameters of each inverter.
    h
        Step (s).
    seconds
        Length of the run (s).

    Returns
    -------
    str
        The model. Node `n13` is bus 13, `s13-152` the switch between 13 and 152; inverters keep their names.
    """
    table = {path.stem: read_table(path) for path in sorted(folder.glob("*.csv"))}
    V_nom = {row["bus"]: float(row["V_nom_kV_LL"]) * 1e3 / sqrt(3) for row in table["buses"]}
    inverters = [row for row in table["inverters"] if row.get("spare") != "yes"]
    leaders = {row["bus"] for row in inverters if row["kind"] == "GFM" and row.get("phases", "") in ("", "ABC")}
    return "\n".join(
        (
            _header(h, seconds, table["buses"][0]["bus"]),
            *network_blocks(table, load_set, V_nom, leaders),
            *node_blocks(inverters, V_nom),
            *inverter_blocks(inverters, start, parameters),
        )
    )


def read_table(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _header(h: float, seconds: int, bus: str) -> str:
    """Clock, modules and what a network that falls apart needs.

    The tolerance of the voltages is 1e-11 pu (1e-6 by default, which costs six digits). `fault_check` finds the
    islands anew when a switch has moved. The recorder of any bus, into nowhere, keeps the clock going: without anything
    that wants to be called again GridLAB-D stops at once.
    """
    step = round(h * 1e9)
    year, month = START[:4], START[5:7]
    return f"""#set show_progress=false
#set deltamode_forced_always=true
#set deltamode_timestep={step}
#set deltamode_iteration_limit=20
#set minimum_timestep=1
clock {{
	timezone UTC0;
	starttime '{START}';
	stoptime '{year}-{month}-01 {_clock(seconds + 2)}';
}}
module tape;
module powerflow {{
	enable_subsecond_models true;
	deltamode_timestep {step};
	solver_method NR;
	all_powerflow_delta true;
	line_capacitance true;
	line_limits false;
	default_maximum_voltage_error 1e-11;
	NR_island_fail_method true;
	NR_iteration_limit 50;
}}
module generators {{
	enable_subsecond_models true;
	deltamode_timestep {step};
}}
module reliability {{
	enable_subsecond_models true;
	deltamode_timestep {step};
	report_event_log false;
}}
object fault_check {{
	name islands;
	check_mode ONCHANGE;
	strictly_radial false;
	grid_association true;
}}
object recorder {{
	name ticker;
	parent n{bus};
	property voltage_A;
	interval 1;
	file "/dev/null";
}}"""


def _clock(seconds: int) -> str:
    """Return the time of day after midnight.

    Examples
    --------
    >>> _clock(3725)
    '01:02:05'
    """
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
