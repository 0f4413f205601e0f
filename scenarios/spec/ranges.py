"""Which numbers a key of a scenario may have."""

from __future__ import annotations

from agents.agent_config import Gains, Handling
from netem.plausible_links import Range
from plant.plant_config import GflParameters, GfmParameters, Protection, SyncCheck
from scenarios.spec.scenario_model import UNIT_OF_KEY, Event, InverterTable, PlantTable, Processes, Scenario, Time

RANGES: dict[tuple[type, str], Range] = {
    (Scenario, "seed"): Range("a seed", "", 0, 2**63 - 1),
    (Time, "end_s"): Range("the duration of a run", "s", 0.001, 3600.0, above_zero=True),
    (Time, "T_c_s"): Range("a control period", "s", 0.0005, 2.0, above_zero=True),
    (Time, "h_s"): Range("an integration step", "s", 1e-5, 0.02, above_zero=True),
    (Time, "record_s"): Range("the distance of recorded rows", "s", 1e-5, 2.0, above_zero=True),
    (PlantTable, "P_set0_pu"): Range("a power set-point", "pu", 0.0, 1.2),
    (PlantTable, "f_nom_Hz"): Range("a nominal frequency", "Hz", 16.0, 400.0),
    (PlantTable, "load_factor"): Range("a factor on the loads", "", 0.0, 10.0),
    (PlantTable, "m_p_factor"): Range("a factor on droops", "", 0.01, 100.0),
    (PlantTable, "m_q_factor"): Range("a factor on droops", "", 0.01, 100.0),
    (InverterTable, "m_p_pu"): Range("a P-f droop", "pu", 0.001, 0.2),
    (InverterTable, "m_q_pu"): Range("a Q-V droop", "pu", 0.001, 0.5),
    (InverterTable, "P_rated_kW"): Range("a rating", "kW", 0.1, 1e6),
    (PlantTable, "V_set0_pu"): Range("a voltage set-point", "pu", 0.8, 1.2, above_zero=True),
    (Protection, "enter_service"): Range("the delay of entering service", "s", 0.01, 3600.0, above_zero=True),
    (Event, "t_s"): Range("the time of an event", "s", 0.0, 3600.0, above_zero=True),
    (Processes, "deadline_s"): Range("a deadline", "s", 0.1, 600.0, above_zero=True),
    (Processes, "port"): Range("a port", "", 0, 65535),
    (Gains, "k_p"): Range("gain k_p", "", 1e-7, 1e3, above_zero=True),
    (Gains, "k_q"): Range("gain k_q", "", 1e-5, 1e5, above_zero=True),
    (Gains, "alpha"): Range("gain alpha", "", 0.0, 1e4),
    (Gains, "alpha_min"): Range("gain alpha_min", "", 0.0, 1e4),
    (Gains, "V_full"): Range("a voltage error", "pu", 0.0, 0.2),
    (Gains, "beta_GFM"): Range("gain beta_GFM", "", 0.0, 1e4),
    (Gains, "beta_GFL"): Range("gain beta_GFL", "", 0.0, 1e4),
    (Gains, "P_set_min"): Range("a limit of P_set", "pu", -1.2, 1.2),
    (Gains, "P_set_max"): Range("a limit of P_set", "pu", -1.2, 2.0),
    (Gains, "V_set_min"): Range("a limit of V_set", "pu", 0.5, 1.5, above_zero=True),
    (Gains, "V_set_max"): Range("a limit of V_set", "pu", 0.5, 1.5, above_zero=True),
    (Handling, "T_age"): Range("a time in which a state ages", "s", 1e-3, 60.0, above_zero=True),
    (Handling, "max_age"): Range("the greatest age of a state", "s", 0.0, 60.0),
    (Handling, "kappa_c"): Range("gain kappa_c", "1/s", 1e-3, 1e4, above_zero=True),
    (Handling, "beta_c"): Range("factor beta_c", "", 0.0, 1e4),
    (Handling, "T_sat"): Range("a time until an inverter counts as saturated", "s", 1e-3, 60.0, above_zero=True),
    (Handling, "slip_max"): Range("the greatest slip within an island", "cycles", 1e-4, 0.5, above_zero=True),
    (SyncCheck, "angle"): Range("a window of angles", "deg", 0.0, 180.0),
    (SyncCheck, "f"): Range("a window of frequencies", "Hz", 0.0, 10.0),
    (SyncCheck, "V"): Range("a window of voltages", "pu", 0.0, 1.0),
    (SyncCheck, "timeout"): Range("the longest wait for synchronism", "s", 0.0, 3600.0),
    (GfmParameters, "w_lim"): Range("the limiters' bound w_lim", "", 0.1, 1e4, above_zero=True),
    (GflParameters, "F_current"): Range("the cross-coupling gain F_current", "", 0.0, 1.0),
}
"""Ranges of single keys; `range_of` gives the rest theirs by unit."""

_LIMITS = {
    **dict.fromkeys(("R_f",), Range("a filter resistance", "pu", 0.0, 1.0)),
    **dict.fromkeys(("X_f",), Range("a filter reactance", "pu", 0.001, 1.0, above_zero=True)),
    **dict.fromkeys(("P_max", "P_min"), Range("a limit of P", "pu", -2.0, 3.0)),
    **dict.fromkeys(("Q_max", "Q_min"), Range("a limit of Q", "pu", -10.0, 10.0)),
    **dict.fromkeys(("P_set_lim",), Range("the bound of P_set", "pu", 0.1, 10.0, above_zero=True)),
    **dict.fromkeys(("V_set_min", "V_set_max"), Range("a bound of V_set", "pu", 0.1, 2.0, above_zero=True)),
    **dict.fromkeys(("E_min", "E_max"), Range("a limit of the internal voltage", "pu", 0.0, 2.0)),
    **dict.fromkeys(("S_max", "i_max"), Range("a limit of apparent power or current", "pu", 0.1, 5.0, above_zero=True)),
    **dict.fromkeys(("V_lim",), Range("the limiters' bound V_lim", "pu", 0.01, 10.0, above_zero=True)),
    **dict.fromkeys(("db_UV", "db_OV"), Range("a dead band", "pu", 0.0, 0.2)),
    **dict.fromkeys(("db_UF", "db_OF"), Range("a dead band", "Hz", 0.0, 5.0)),
}


def range_of(cls: type, name: str) -> Range | None:
    """Range of a field, or None when it is no number that could be wrong by itself."""
    if (cls, name) in RANGES:
        return RANGES[cls, name]
    if cls not in (GfmParameters, GflParameters):
        return None
    if name in _LIMITS:
        return _LIMITS[name]
    if UNIT_OF_KEY[cls].get(name) == "s":
        return Range("a time constant", "s", 1e-5, 10.0, above_zero=True)
    return Range(f"gain {name}", "", 0.0, 1e6)
