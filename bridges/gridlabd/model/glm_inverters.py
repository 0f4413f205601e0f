"""A feeder's inverters as GridLAB-D objects (`inverter_dyn`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import pi

from gridpeers.bridges.gridlabd.model.glm_block import TableRow, block
from gridpeers.bridges.gridlabd.model.glm_network import F_NOM
from gridpeers.plant.equipment.inverter_parameters import GflParameters, GfmParameters, InverterParameters


def node_of(bus: str, phases: str) -> str:
    """Return the node of an inverter: that of its bus, or one of its own at a single phase (empty phases are all).

    Examples
    --------
    >>> node_of("13", ""), node_of("13", "B")
    ('n13', 'n13_B')
    """
    return f"n{bus}" if phases in ("", "ABC") else f"n{bus}_{phases}"


def node_blocks(rows: Iterable[TableRow], V_nom: Mapping[str, float]) -> list[str]:
    """Return the nodes of single-phase inverters, from the buses' nominal voltages (V).

    An inverter of GridLAB-D has the phases of its node, so it gets a child of its bus with its own phase alone.
    """
    return [
        block("node", name=node, parent=bus, phases=f"{row['phases']}N", nominal_voltage=V_nom[row["bus"]])
        for row in rows
        if (node := node_of(row["bus"], row.get("phases", ""))) != (bus := f"n{row['bus']}")
    ]


def inverter_blocks(
    rows: Iterable[TableRow], start: Mapping[str, complex], parameters: Mapping[str, InverterParameters]
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


def _gfm(row: TableRow, gfm: GfmParameters) -> dict[str, str | float]:
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
        "Imax": gfm.I_max,
    }


def _gfl(row: TableRow, gfl: GflParameters) -> dict[str, str | float]:
    """Parameters of a GFL, on the base that GridLAB-D ties its apparent-power limit to.

    There this limit is 1 pu of `rated_power`. With ours at S_max pu of the rating, `rated_power` is S_max ratings and
    everything per unit is converted to that base.
    """
    base = gfl.S_max
    voltage_source = gfl.model == "voltage_source"
    return {
        "control_mode": "GRID_FOLLOWING" if voltage_source else "GFL_CURRENT_SOURCE",
        "grid_following_mode": gfl.mode.upper(),
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
