"""Quantities by which runs are judged: their names for people, units and precision."""

from __future__ import annotations

from typing import Literal

Quantity = Literal["f_error_Hz", "MPSI", "V_error", "MQSI"]
"""A column of the tables, named as in metrics.json."""

Measure = Quantity | Literal["p"]
"""A steady value: a quantity of the tables, or the powers of the inverters."""

UNITS: dict[Measure, str] = {"f_error_Hz": " Hz", "MPSI": "", "V_error": " pu", "MQSI": "", "p": " pu"}
"""Unit as it follows a number."""

DIGITS: dict[Measure, int] = {"f_error_Hz": 2, "MPSI": 2, "V_error": 3, "MQSI": 2, "p": 2}
"""Decimals that make sense, and that the paper prints: smaller differences vary from run to run of a microgrid."""


def label(measure: str, f_nom: float = 60.0) -> str:
    """Return the name of a measure for people, at a nominal frequency (Hz).

    Examples
    --------
    >>> label("f_error_Hz"), label("MPSI"), label("f_error_Hz", 50.0)
    ('abs(f-60)', 'MPSI', 'abs(f-50)')
    """
    return {"f_error_Hz": f"abs(f-{f_nom:g})", "p": "P"}.get(measure, measure)


def heading(quantity: Quantity, f_nom: float = 60.0) -> str:
    """Return the heading of a column, with the unit, at a nominal frequency (Hz).

    Examples
    --------
    >>> heading("f_error_Hz", 50.0), heading("V_error")
    ('abs(f-50) Hz', 'V_error pu')
    """
    return f"{label(quantity, f_nom)}{UNITS[quantity]}"


HEADINGS: dict[Quantity, str] = {
    "f_error_Hz": heading("f_error_Hz"),
    "MPSI": heading("MPSI"),
    "V_error": heading("V_error"),
    "MQSI": heading("MQSI"),
}
"""Headings of the columns at the paper's nominal frequency, 60 Hz."""
