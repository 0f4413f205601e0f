"""The settled quantities that tables show: their headings, units and decimals."""

from __future__ import annotations

from typing import Literal

Quantity = Literal["f_error_Hz", "MPSI", "V_error", "MQSI"]
"""A column, named as in metrics.json."""

HEADINGS: dict[Quantity, str] = {
    "f_error_Hz": "abs(f-60) Hz",
    "MPSI": "MPSI",
    "V_error": "V_error pu",
    "MQSI": "MQSI",
}
"""Heading of a column, with the unit."""


def heading(quantity: Quantity, f_nom: float) -> str:
    """Heading of a column of a run whose nominal frequency (Hz) need not be the paper's.

    Examples
    --------
    >>> heading("f_error_Hz", 50.0), heading("MPSI", 50.0)
    ('abs(f-50) Hz', 'MPSI')
    """
    return f"abs(f-{f_nom:g}) Hz" if quantity == "f_error_Hz" else HEADINGS[quantity]


UNITS: dict[Quantity, str] = {"f_error_Hz": " Hz", "MPSI": "", "V_error": " pu", "MQSI": ""}
"""Unit as it follows a number."""

DIGITS: dict[Quantity, int] = {"f_error_Hz": 2, "MPSI": 2, "V_error": 3, "MQSI": 2}
"""Decimals that make sense: what is less moves from run to run of a real microgrid."""
