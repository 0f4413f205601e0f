"""Units and words for the columns of a sweep's table."""

from __future__ import annotations

import re
import typing
from typing import Any

import msgspec

from scenarios.field_docs import field_docs
from scenarios.schema.scenario_model import ScenarioModel

_SUFFIXES = ("s", "Hz", "pu", "W", "var", "V")

WORDS = {
    "f_error_Hz": "settled abs(f - f_nom) (Hz)",
    "MPSI": "settled power sharing index, MPSI",
    "V_error": "settled mean abs(V - 1) (pu)",
    "MQSI": "settled var sharing index, MQSI",
    "t_restore_s": "time to restore f and sharing (s)",
    "t_load_s": "time to take over the load (s)",
    "t_f_s": "time to restore f (s)",
    "t_share_s": "time to share power (s)",
    "f_swing_Hz": "swing of f at the end (Hz)",
    "V_swing_pu": "swing of V at the end (pu)",
    "steady": "steady at the end (1: yes, 0: no)",
}
"""What is written at the axes instead of an index's name."""

KEYS = {
    "graph.links": "links of the graph",
    "graph.lambda_2": "algebraic connectivity, lambda_2",
    "gains.k_p": "gain of P_set, k_p (s)",
    "gains.k_q": "gain of V_set, k_q (s)",
    "gains.alpha": "weight of the voltage error, alpha",
    "gains.beta_GFM": "weight of var sharing, GFM, beta",
    "gains.beta_GFL": "weight of var sharing, GFL, beta",
    "time.T_c_s": "control period, T_c (s)",
    "time.h_s": "integration step, h (s)",
    "time.end_s": "end of the run (s)",
    "plant.P_set0_pu": "first P_set (pu)",
    "plant.V_set0_pu": "first V_set (pu)",
    "plant.load_set": "load set",
    "link.on": "which links",
    "link.delay": "delay of the links (s)",
    "link.loss": "probability of loss",
    "link.duplicate": "probability of duplicates",
    "link.corrupt": "probability of flipped bits",
    "link.rate": "rate of the links (byte/s)",
    "link.from_s": "faults begin at (s)",
    "link.to_s": "faults end at (s)",
}
"""What is written at the axes instead of a key of the scenario file, less its case and its number in a list."""

LEAST = {
    "f_error_Hz": 0.01,
    "MPSI": 0.01,
    "V_error": 0.001,
    "MQSI": 0.01,
    "t_restore_s": 0.02,
    "t_load_s": 0.02,
    "t_f_s": 0.02,
    "t_share_s": 0.02,
    "f_swing_Hz": 0.001,
    "V_swing_pu": 0.0001,
    "steady": 1.0,
}
"""Least length of an axis of an index, in its unit: what is smaller is rounding, or nothing that anybody would see.

Settled indexes have the last digit that the paper prints, times a usual control period.
"""


def unit_of(name: str) -> str:
    """Return the unit of a column, which its last word ends in; V_error and p are per unit.

    Examples
    --------
    >>> unit_of("event1.t_restore_s"), unit_of("time.T_c_s"), unit_of("gains.k_p"), unit_of("event1.p.inv1")
    ('s', 's', '', 'pu')
    """
    parts = name.split(".")
    if parts[-1] == "V_error" or parts[-2:-1] == ["p"]:
        return "pu"
    suffix = parts[-1].rpartition("_")[2]
    return suffix if suffix in _SUFFIXES and suffix != parts[-1] else ""


def label_of(name: str) -> str:
    """Return words for an axis, with the unit.

    A key without words of its own is named by its last part and its table, with the unit that its documentation tells.

    Examples
    --------
    >>> label_of("time.T_c_s"), label_of("case.IV.gains.k_p"), label_of("link[1].delay")
    ('control period, T_c (s)', 'gain of P_set, k_p (s), case IV', 'delay of the links (s)')
    >>> label_of("handling.T_age_s"), label_of("plant.gfm.k_pp"), label_of("handling.kappa_c")
    ('T_age of [handling] (s)', 'k_pp of [plant.gfm]', 'kappa_c of [handling] (1/s)')
    """
    if name.rpartition(".")[2] in WORDS:
        return WORDS[name.rpartition(".")[2]]
    case = re.match(r"case\.([^.]+)\.", name)
    suffix = f", case {case.group(1)}" if case else ""
    key = re.sub(r"\[\d+\]", "", name[case.end() :] if case else name)
    if key in KEYS:
        return f"{KEYS[key]}{suffix}"
    table, _, last = key.rpartition(".")
    unit = unit_of(key)
    words = f"{last.removesuffix('_' + unit)}" + (f" of [{table}]" if table else "")
    unit = unit or _documented_unit(key)
    return f"{words} ({unit}){suffix}" if unit else f"{words}{suffix}"


def _documented_unit(key: str) -> str:
    """Return the unit in the documentation of a key of the scenario file; "" where there is none, or no such key."""
    tables: Any = ScenarioModel
    text = ""
    for step in key.split("."):
        docs = {doc.name: doc for doc in field_docs(tables)} if tables is not None else {}
        if step not in docs:
            return ""
        text = docs[step].text
        tables = _struct_in(typing.get_type_hints(tables).get(step))
    found = re.search(r"\((s|1/s|Hz|pu|W|V|var)\b[^)]*\)", text)
    return found.group(1) if found else ""


def _struct_in(annotation: Any) -> type[msgspec.Struct] | None:
    """Return the struct that a field is, or has in a list or as an option."""
    if isinstance(annotation, type) and issubclass(annotation, msgspec.Struct):
        return annotation
    return next((found for part in typing.get_args(annotation) if (found := _struct_in(part))), None)
