"""Write a feeder of `plant/data` as a GridLAB-D model (GLM).

This file reads the tables by itself and shares no code with `plant.tables` and `plant.network`, so that a problem
there shows as a difference. Only the inverters' parameters come as `plant.plant_config` has them.
"""

from __future__ import annotations

import cmath
import csv
from collections.abc import Collection, Iterable, Mapping
from math import pi, sqrt
from pathlib import Path

from plant.plant_config import GflParameters, GfmParameters

F_NOM = 60.0
"""Nominal frequency (Hz)."""

FOOT, MILE = 0.3048e-3, 1.609344
"""Length (km): GridLAB-D takes lines in feet and impedances per mile."""

NOMINAL_ANGLE = {"A": 0.0, "B": -2 * pi / 3, "C": 2 * pi / 3, "AB": pi / 6, "BC": -pi / 2, "CA": 5 * pi / 6}
"""Of a load branch (rad): phase to ground, or phase to phase."""

NO_LIMIT = 1e3
"""Phase-current limit (pu): we have none. GridLAB-D's default of 2 pu acts only at a closing out of phase."""

START = "2000-01-01 00:00:00"
"""GridLAB-D's clock at the start; delta mode begins one second later."""

Row = Mapping[str, str]


def write_glm(
    folder: Path,
    load_set: str,
    start: Mapping[str, complex],
    gfm: GfmParameters,
    gfl: GflParameters,
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
    gfm, gfl
        Parameters of the inverters.
    h
        Step (s).
    seconds
        Length of the run (s).

    Returns
    -------
    str
        The model. Node `n13` is bus 13, `s13-152` the switch between 13 and 152; inverters keep their names.
    """
    table = {path.stem: _read(path) for path in sorted(folder.glob("*.csv"))}
    V_nom = {row["bus"]: float(row["V_nom_kV_LL"]) * 1e3 / sqrt(3) for row in table["buses"]}
    inverters = [row for row in table["inverters"] if row.get("spare") != "yes"]
    return "\n".join(
        (
            _header(h, seconds, table["buses"][0]["bus"]),
            *_buses(
                table["buses"], V_nom, table["source"][0], {row["bus"] for row in inverters if row["kind"] == "GFM"}
            ),
            *_lines(table["lines"], table["line_configs"]),
            *_switches(table["switches"]),
            *_regulators(table["regulators"]),
            *_loads(table[f"loads_{load_set}"], V_nom),
            *_capacitors(table["capacitors"], V_nom),
            *_inverters(inverters, start, gfm, gfl),
        )
    )


def _read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _number(value: complex | float) -> str:
    """Write a number so that reading gives the same bits."""
    if isinstance(value, complex):
        return f"{value.real!r}{value.imag:+.17g}j"
    return repr(value)


def _block(kind: str, **properties: str | int | float | complex) -> str:
    """Write an object; names end in an underscore where Python has a keyword."""
    lines = [f"\t{name} {value if isinstance(value, str) else _number(value)};" for name, value in properties.items()]
    return "\n".join((f"object {kind} {{", *lines, "}"))


def _header(h: float, seconds: int, bus: str) -> str:
    """Clock, modules and what a network that falls apart needs.

    The tolerance of the voltages is 1e-11 pu (1e-6 by default, which costs six digits). `fault_check` finds the
    islands anew when a switch has moved. The recorder of any bus, into nowhere, keeps the clock going: without anything
    that wants to be called again GridLAB-D stops at once.
    """
    step = round(h * 1e9)
    year, month = START[:4], START[5:7]
    return f"""#set deltamode_forced_always=true
#set deltamode_timestep={step}
#set deltamode_iteration_limit=20
#set minimum_timestep=1
clock {{
	timezone UTC0;
	starttime '{START}';
	stoptime '{year}-{month}-01 00:00:{seconds + 2:02d}';
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


def _buses(rows: Iterable[Row], V_nom: Mapping[str, float], source: Row, leaders: Collection[str]) -> list[str]:
    """Nodes; only a SWING, or a SWING_PQ where there is none, lets GridLAB-D keep an island alive."""
    blocks = []
    for row in rows:
        name, V = row["bus"], V_nom[row["bus"]]
        swing: dict[str, str | complex] = {}
        if name == source["bus"]:
            turned = cmath.rect(float(source["V_pu"]) * V, float(source["angle_deg"]) * pi / 180)
            swing = {f"voltage_{phase}": turned * cmath.rect(1.0, NOMINAL_ANGLE[phase]) for phase in "ABC"}
            swing["bustype"] = "SWING"
        elif name in leaders:
            swing["bustype"] = "SWING_PQ"
        blocks.append(_block("node", name=f"n{name}", phases=row["phases"] + "N", nominal_voltage=V, **swing))
    return blocks


def _lines(rows: Iterable[Row], configs: Iterable[Row]) -> list[str]:
    """Lines as a pi: series impedance (ohm per mile) and shunt capacitance (nF per mile)."""
    kinds: dict[str, dict[str, complex | float]] = {}
    for row in configs:
        per_mile = complex(float(row["R_ohm_per_km"]), float(row["X_ohm_per_km"])) * MILE
        nF = float(row["B_uS_per_km"]) * 1e-6 / (2 * pi * F_NOM) * 1e9 * MILE
        i, j = ("ABC".index(row[end]) + 1 for end in ("phase_1", "phase_2"))
        kind = kinds.setdefault(row["config"], {})
        kind |= {f"z{i}{j}": per_mile, f"z{j}{i}": per_mile, f"c{i}{j}": nF, f"c{j}{i}": nF}
    blocks = [_block("line_configuration", name=f"c{config}", **kind) for config, kind in kinds.items()]
    for row in rows:
        blocks.append(
            _block(
                "overhead_line",
                name=f"l{row['line']}",
                from_=f"n{row['from_bus']}",
                to=f"n{row['to_bus']}",
                phases=row["phases"] + "N",
                length=float(row["length_m"]) / 1e3 / FOOT,
                configuration=f"c{row['config']}",
            ).replace("from_ ", "from ")
        )
    return blocks


def _switches(rows: Iterable[Row]) -> list[str]:
    return [
        _block(
            "switch",
            name=f"s{row['from_bus']}-{row['to_bus']}",
            from_=f"n{row['from_bus']}",
            to=f"n{row['to_bus']}",
            phases=row["phases"] + "N",
            status=row["state"].upper(),
            operating_mode="BANKED",
        ).replace("from_ ", "from ")
        for row in rows
    ]


def _regulators(rows: Iterable[Row]) -> list[str]:
    """Regulators at fixed taps, GridLAB-D's type A: V_to = (1 + tap tap_step) V_from."""
    taps: dict[tuple[str, str, str, float], dict[str, int]] = {}
    for row in rows:
        key = row["regulator"], row["from_bus"], row["to_bus"], float(row["tap_step_pu"])
        taps.setdefault(key, {}).update(dict.fromkeys(row["phases"], int(row["tap"])))
    blocks = []
    for (name, start, end, step), tap in taps.items():
        blocks.append(
            _block(
                "regulator_configuration",
                name=f"c{name}",
                connect_type="WYE_WYE",
                Control="MANUAL",
                Type="A",
                raise_taps=16,
                lower_taps=16,
                regulation=16 * step,
                **{f"tap_pos_{phase}": at for phase, at in tap.items()},
            )
        )
        blocks.append(
            _block(
                "regulator",
                name=name,
                from_=f"n{start}",
                to=f"n{end}",
                phases="".join(sorted(tap)) + "N",
                configuration=f"c{name}",
            ).replace("from_ ", "from ")
        )
    return blocks


def _loads(rows: Iterable[Row], V_nom: Mapping[str, float]) -> list[str]:
    """Spot loads, each at a load object of its own below its bus."""
    blocks = []
    for number, row in enumerate(rows):
        ends = ("AB", "BC", "CA") if row["connection"] == "D" else ("A", "B", "C")
        V = V_nom[row["bus"]] * (sqrt(3) if row["connection"] == "D" else 1.0)
        values: dict[str, complex] = {}
        for end, letter in zip(ends, "abc", strict=True):
            S = complex(float(row[f"P_{letter}_kW"]), float(row[f"Q_{letter}_kvar"])) * 1e3
            if not S:
                continue
            if row["model"] == "P":
                values[f"constant_power_{end}"] = S
            elif row["model"] == "I":
                values[f"constant_current_{end}"] = (S / cmath.rect(V, NOMINAL_ANGLE[end])).conjugate()
            else:
                values[f"constant_impedance_{end}"] = V**2 / S.conjugate()
        phases = "".join(sorted({phase for name in values for phase in name.rpartition("_")[2]}))
        blocks.append(_load(f"load{number}", row["bus"], V_nom, phases, values))
    return blocks


def _capacitors(rows: Iterable[Row], V_nom: Mapping[str, float]) -> list[str]:
    """Capacitor banks, as the constant impedances that they are."""
    blocks = []
    for number, row in enumerate(rows):
        V = float(row["V_rated_kV_LN"]) * 1e3
        Q = {phase: float(row[f"Q_{phase.lower()}_kvar"]) * 1e3 for phase in "ABC"}
        Z = {f"constant_impedance_{phase}": complex(0.0, -(V**2) / var) for phase, var in Q.items() if var}
        phases = "".join(name[-1] for name in Z)
        blocks.append(_load(f"bank{number}", row["bus"], V_nom, phases, Z))
    return blocks


def _load(name: str, bus: str, V_nom: Mapping[str, float], phases: str, values: Mapping[str, complex]) -> str:
    """One load object at a bus: its phases, and its powers, currents or impedances by GridLAB-D's names."""
    return _block(
        "load", name=f"{name}_{bus}", parent=f"n{bus}", phases=phases + "N", nominal_voltage=V_nom[bus], **values
    )


def _inverters(rows: Iterable[Row], start: Mapping[str, complex], gfm: GfmParameters, gfl: GflParameters) -> list[str]:
    blocks = []
    for row in rows:
        S = start[row["name"]]
        unit = _gfm(row, gfm) if row["kind"] == "GFM" else _gfl(row, gfl)
        blocks.append(
            _block(
                "inverter_dyn",
                name=row["name"],
                parent=f"n{row['bus']}",
                flags="DELTAMODE",
                Pref=S.real,
                Qref=S.imag,
                frequency_convergence_criterion=1e-9,
                voltage_convergence_criterion=1e-9,
                current_convergence_criterion=1e-9,
                Imax=NO_LIMIT,
                **unit,
            )
        )
    return blocks


def _gfm(row: Row, gfm: GfmParameters) -> dict[str, str | float]:
    return {
        "control_mode": "GRID_FORMING",
        "P_f_droop_setting_mode": "PSET_MODE",
        "rated_power": float(row["P_rated_kW"]) * 1e3,
        "mp": float(row["m_p_pu"]) * 2 * pi * F_NOM,
        "mq": float(row["m_q_pu"]),
        "Rfilter": gfm.R_f,
        "Xfilter": gfm.X_f,
        "Tp": gfm.T_p,
        "Tq": gfm.T_q,
        "Tv": gfm.T_v,
        "Pmax": gfm.P_max,
        "Pmin": gfm.P_min,
        "kppmax": gfm.k_pp,
        "kipmax": gfm.k_ip,
        "w_lim": gfm.w_lim,
        "Qmax": gfm.Q_max,
        "Qmin": gfm.Q_min,
        "kpqmax": gfm.k_pq,
        "kiqmax": gfm.k_iq,
        "kpv": gfm.k_pv,
        "kiv": gfm.k_iv,
        "E_min": gfm.E_min,
        "E_max": gfm.E_max,
    }


def _gfl(row: Row, gfl: GflParameters) -> dict[str, str | float]:
    """Parameters of a GFL, on the base that GridLAB-D ties its apparent-power limit to.

    There this limit is 1 pu of `rated_power`. With ours at S_max pu of the rating, `rated_power` is S_max ratings and
    everything per unit is converted to that base.
    """
    base = gfl.S_max
    voltage_source = gfl.model == "voltage_source"
    return {
        "control_mode": "GRID_FOLLOWING" if voltage_source else "GFL_CURRENT_SOURCE",
        "grid_following_mode": "POSITIVE_SEQUENCE",
        "rated_power": float(row["P_rated_kW"]) * 1e3 * base,
        "Rp": float(row["m_p_pu"]) * base,
        "Rq": float(row["m_q_pu"]) * base,
        "Rfilter": gfl.R_f * base,
        "Xfilter": gfl.X_f * base,
        "kpPLL": gfl.k_pPLL,
        "kiPLL": gfl.k_iPLL,
        "kpc": gfl.k_pc * base,
        "kic": gfl.k_ic * base,
        "F_current": gfl.F_current,
        "Tif": gfl.T_if,
        "frequency_watt": str(gfl.frequency_watt).lower(),
        "volt_var": str(gfl.volt_var).lower(),
        "Tff": gfl.T_ff,
        "Tpf": gfl.T_pf,
        "Tvf": gfl.T_vf,
        "Tqf": gfl.T_qf,
        "db_UF": gfl.db_UF,
        "db_OF": gfl.db_OF,
        "db_UV": gfl.db_UV,
        "db_OV": gfl.db_OV,
        "Pref_max": gfl.P_max / base,
        "Pref_min": gfl.P_min / base,
        "igd_ref_max": gfl.i_max / base,
        "igd_ref_min": -gfl.i_max / base,
        "igq_ref_max": gfl.i_max / base,
        "igq_ref_min": -gfl.i_max / base,
    }
