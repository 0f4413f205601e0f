"""Which numbers a key may have, and what was probably meant by one that is out of range.

A range is wide: it holds every value that somebody might want to try, and none that only a lost unit explains.
"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from agents.config import Gains, Handling
from plant.config import GflParameters, GfmParameters
from scenarios.spec.model import UNIT_OF_KEY, Event, PlantTable, Processes, Time


class Range(NamedTuple):
    """Numbers that make sense, bounds included."""

    what: str
    """What the number is, for the sentence."""
    unit: str
    """"s", "pu", "Hz", "1/s" or ""."""
    low: float
    """Lowest value; with `above_zero` that of plausible ones, and zero and less is an error of its own."""
    high: float
    """Highest value."""
    above_zero: bool = False
    """Whether zero makes no sense at all."""


RANGES: dict[tuple[type, str], Range] = {
    (Time, "end_s"): Range("the duration of a run", "s", 0.001, 3600.0, above_zero=True),
    (Time, "T_c_s"): Range("a control period", "s", 0.0005, 2.0, above_zero=True),
    (Time, "h_s"): Range("an integration step", "s", 1e-5, 0.02, above_zero=True),
    (Time, "record_s"): Range("the distance of recorded rows", "s", 1e-5, 2.0, above_zero=True),
    (PlantTable, "P_set0_pu"): Range("a power set-point", "pu", 0.0, 1.2),
    (PlantTable, "V_set0_pu"): Range("a voltage set-point", "pu", 0.8, 1.2, above_zero=True),
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
    (GfmParameters, "w_lim"): Range("the limiters' bound w_lim", "", 0.1, 1e4, above_zero=True),
    (GflParameters, "F_current"): Range("the cross-coupling gain F_current", "", 0.0, 1.0),
}
"""Ranges of single keys; `range_of` gives the rest theirs by unit."""

_LIMITS = {
    **dict.fromkeys(("R_f",), Range("a filter resistance", "pu", 0.0, 1.0)),
    **dict.fromkeys(("X_f",), Range("a filter reactance", "pu", 0.001, 1.0, above_zero=True)),
    **dict.fromkeys(("P_max", "P_min"), Range("a limit of P", "pu", -2.0, 3.0)),
    **dict.fromkeys(("Q_max", "Q_min"), Range("a limit of Q", "pu", -10.0, 10.0)),
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


def objection(value: float, allowed: Range) -> str | None:
    """Why a number cannot be right, and what would be; None when it can.

    Examples
    --------
    >>> objection(20.0, RANGES[Time, "T_c_s"])
    '20 s is not plausible for a control period (0.0005 to 2 s); did you mean 0.02 (20 ms)?'
    >>> objection(-0.02, RANGES[Time, "T_c_s"])
    'a control period must be above 0, got -0.02 s; 0.0005 to 2 s makes sense'
    >>> objection(64.7, RANGES[PlantTable, "P_set0_pu"])
    '64.7 pu is not plausible for a power set-point (0 to 1.2 pu); did you mean 0.647 (64.7 %)?'
    """
    unit = f" {allowed.unit}" if allowed.unit else ""
    span = f"{allowed.low:g} to {allowed.high:g}{unit}"
    if not math.isfinite(value):
        return f"{allowed.what} must be a finite number, got {value}; {span} makes sense"
    if allowed.above_zero and value <= 0:
        return f"{allowed.what} must be above 0, got {value:g}{unit}; {span} makes sense"
    if allowed.low <= value <= allowed.high:
        return None
    return f"{value:g}{unit} is not plausible for {allowed.what} ({span}){_meant(value, allowed)}"


def number_in(text: str) -> str:
    """What to write instead of a text with a unit, or "" when it is not one.

    Examples
    --------
    >>> number_in("20 ms"), number_in("64.7%"), number_in("soon")
    ('; write 0.02', '; write 0.647', '')
    """
    match = re.fullmatch(r"\s*([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s*(us|ms|s|%|pu|Hz|mHz)?\s*", text)
    if match is None:
        return ""
    factor = {"us": 1e-6, "ms": 1e-3, "%": 1e-2, "mHz": 1e-3}.get(match[2] or "", 1.0)
    return f"; write {float(match[1]) * factor:g}"


def _meant(value: float, allowed: Range) -> str:
    factor, name = {"s": (1000.0, "ms"), "pu": (100.0, "%"), "Hz": (1000.0, "mHz")}.get(allowed.unit, (1.0, ""))
    if name and allowed.low <= value / factor <= allowed.high and (not allowed.above_zero or value > 0):
        return f"; did you mean {value / factor:g} ({value:g} {name})?"
    if allowed.unit == "pu" and abs(value) > 100:
        return "; it is per unit of the inverter's own rating, neither kW nor V"
    return ""
