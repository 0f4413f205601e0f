"""Units and words for the columns of a sweep's table."""

from __future__ import annotations

_SUFFIXES = ("s", "Hz", "pu", "W", "var", "V")

WORDS = {
    "f_error_Hz": "settled abs(f - 60 Hz) (Hz)",
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
    "graph.links": "links",
    "graph.lambda_2": "algebraic connectivity, lambda_2",
}
"""What is written at the axes instead of a column's name."""


def unit_of(name: str) -> str:
    """Unit of a column, which its last word ends in; V_error and p are per unit.

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
    """Words for an axis, with the unit.

    Examples
    --------
    >>> label_of("time.T_c_s"), label_of("gains.k_p"), label_of("event1.MPSI")
    ('time.T_c (s)', 'gains.k_p', 'settled power sharing index, MPSI')
    """
    if name in WORDS:
        return WORDS[name]
    if name.rpartition(".")[2] in WORDS:
        return WORDS[name.rpartition(".")[2]]
    unit = unit_of(name)
    return f"{name.removesuffix('_' + unit)} ({unit})" if unit else name
