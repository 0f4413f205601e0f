"""A feeder of our tables as a GridLAB-D model (GLM) that steps its inverters in delta mode."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from math import pi, sqrt
from pathlib import Path

from gridpeers.bridges.gridlabd.glm_network import F_NOM, TableRow, block, network_blocks
from gridpeers.plant.equipment.inverter_parameters import GflParameters, GfmParameters, InverterParameters


def node_of(bus: str, phases: str) -> str:
    """Return the node of an inverter: that of its bus, or one of its own at a single phase (empty phases are all).

    >>> node_of("13", ""), node_of("13", "B")
    ('n13', 'n13_B')
    """
    return f"n{bus}" if phases in ("", "ABC") else f"n{bus}_{phases}"


def inverter_blocks(
    rows: Sequence[TableRow], start: Mapping[str, complex], parameters: Mapping[str, InverterParameters]
) -> list[str]:
    """Return the objects of inverters, with the powers (VA) that they deliver at the start."""
    blocks = []
    for row in rows:
        S, own = start[row["name"]], parameters[row["name"]]
        unit = _gfm(row, own) if isinstance(own, GfmParameters) else _gfl(row, own)
        blocks.append(
            block(
                "inverter_dyn",
                name=row["name"],
                parent=node_of(row["bus"], row.get("phases", "")),
                flags="DELTAMODE",
                Pref=S.real,
                Qref=S.imag,
                frequency_convergence_criterion=1e-9,
                voltage_convergence_criterion=1e-9,
                current_convergence_criterion=1e-9,
                **unit,
            )
        )
    return blocks


GFM_KEYS = (
    *(("Rfilter", "R_f"), ("Xfilter", "X_f"), ("Tp", "T_p"), ("Tq", "T_q"), ("Tv", "T_v"), ("Imax", "I_max")),
    *(("Pmax", "P_max"), ("Pmin", "P_min"), ("kppmax", "k_pp"), ("kipmax", "k_ip"), ("w_lim", "w_lim")),
    *(("Qmax", "Q_max"), ("Qmin", "Q_min"), ("kpqmax", "k_pq"), ("kiqmax", "k_iq"), ("kpv", "k_pv"), ("kiv", "k_iv")),
    *(("E_min", "E_min"), ("E_max", "E_max")),
)  # properties of GridLAB-D, and our parameters
GFL_KEYS = (
    *(("kpPLL", "k_pPLL"), ("kiPLL", "k_iPLL"), ("F_current", "F_current"), ("Tif", "T_if"), ("Tff", "T_ff")),
    *(("Tpf", "T_pf"), ("Tvf", "T_vf"), ("Tqf", "T_qf")),
    *(("db_UF", "db_UF"), ("db_OF", "db_OF"), ("db_UV", "db_UV"), ("db_OV", "db_OV")),
)
GFL_IMPEDANCES = (("Rfilter", "R_f"), ("Xfilter", "X_f"), ("kpc", "k_pc"), ("kic", "k_ic"))


def _gfm(row: TableRow, gfm: GfmParameters) -> dict[str, str | float]:
    return {
        "control_mode": "GRID_FORMING",
        "P_f_droop_setting_mode": "PSET_MODE",
        "rated_power": float(row["P_rated_kW"]) * 1e3,
        "mp": float(row["m_p_pu"]) * 2 * pi * F_NOM,
        "mq": float(row["m_q_pu"]),
        **{key: getattr(gfm, own) for key, own in GFM_KEYS},
    }


def _gfl(row: TableRow, gfl: GflParameters) -> dict[str, str | float]:
    """Parameters of a GFL, on the base that GridLAB-D ties its apparent-power limit to.

    There this limit is 1 pu of `rated_power`. With ours at S_max pu of the rating, `rated_power` is S_max ratings and
    everything per unit is converted to that base.
    """
    base, i_max = gfl.S_max, gfl.i_max / gfl.S_max
    return {
        "control_mode": "GRID_FOLLOWING" if gfl.model == "voltage_source" else "GFL_CURRENT_SOURCE",
        "grid_following_mode": gfl.mode.upper(),
        "rated_power": float(row["P_rated_kW"]) * 1e3 * base,
        "Rp": float(row["m_p_pu"]) * base,
        "Rq": float(row["m_q_pu"]) * base,
        **{key: getattr(gfl, own) * base for key, own in GFL_IMPEDANCES},
        **{key: getattr(gfl, own) for key, own in GFL_KEYS},
        "frequency_watt": str(gfl.frequency_watt).lower(),
        "volt_var": str(gfl.volt_var).lower(),
        "Pref_max": gfl.P_max / base,
        "Pref_min": gfl.P_min / base,
        **{f"ig{axis}_ref_{end}": sign * i_max for axis in "dq" for end, sign in (("max", 1.0), ("min", -1.0))},
    }


START = "2000-01-01 00:00:00"  # GridLAB-D's clock at the start; delta mode begins one second later


def write_glm(
    folder: Path,
    load_set: str,
    start: Mapping[str, complex],
    parameters: Mapping[str, InverterParameters],
    h: float,
    seconds: int,
) -> str:
    """Write a feeder with its inverters, spares left out, from its tables in `folder` (plant/data/README.md).

    Node `n13` is bus 13, `s13-152` the switch between 13 and 152; inverters keep their names. `start` has the power
    (VA) of each at the start; `h` is the step (s), `seconds` the length of the run.
    """
    table = read_tables(folder)
    V_nom = {row["bus"]: float(row["V_nom_kV_LL"]) * 1e3 / sqrt(3) for row in table["buses"]}
    inverters = [row for row in table["inverters"] if row.get("spare") != "yes"]
    leaders = {row["bus"] for row in inverters if row["kind"] == "GFM" and row.get("phases", "") in ("", "ABC")}
    nodes = [  # an inverter of GridLAB-D has the phases of its node: a single-phase one gets a child of its bus
        block("node", name=node, parent=bus, phases=f"{row['phases']}N", nominal_voltage=V_nom[row["bus"]])
        for row in inverters
        if (node := node_of(row["bus"], row.get("phases", ""))) != (bus := f"n{row['bus']}")
    ]
    network = network_blocks(table, load_set, V_nom, leaders)
    head = _header(h, seconds, table["buses"][0]["bus"])
    return "\n".join((head, *network, *nodes, *inverter_blocks(inverters, start, parameters)))


def read_tables(folder: Path) -> dict[str, list[dict[str, str]]]:
    found = {}
    for path in sorted(folder.glob("*.csv")):
        with path.open(newline="", encoding="utf-8") as file:
            found[path.stem] = list(csv.DictReader(file))
    return found


def _header(h: float, seconds: int, bus: str) -> str:
    """Clock, modules and what a network that falls apart needs.

    The tolerance of the voltages is 1e-11 pu (1e-6 by default, which costs six digits). `fault_check` finds the
    islands anew when a switch has moved. The recorder of any bus, into nowhere, keeps the clock going: without anything
    that wants to be called again GridLAB-D stops at once.
    """
    step, stop = round(h * 1e9), seconds + 2
    clock = f"{stop // 3600:02d}:{stop // 60 % 60:02d}:{stop % 60:02d}"
    return f"""#set show_progress=false
#set deltamode_forced_always=true
#set deltamode_timestep={step}
#set deltamode_iteration_limit=20
#set minimum_timestep=1
clock {{
	timezone UTC0;
	starttime '{START}';
	stoptime '{START[:10]} {clock}';
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
