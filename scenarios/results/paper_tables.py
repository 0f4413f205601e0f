"""The numbers that the paper prints, and how near ours must come.

Singhal, Vu, Du, "Consensus Control for Coordinating Grid-Forming and Grid-Following Inverters in Microgrids",
IEEE Trans. Smart Grid 2022.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Quantity = Literal["f_error_Hz", "MPSI", "V_error", "MQSI"]
"""A column of Tables I and II, named as in metrics.json."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """What one column of a table of the paper shows."""

    table: Literal["I", "II"]
    """Number of the table."""
    quantity: Quantity
    heading: str
    """Heading, with the unit."""
    digits: int
    """Decimals the paper prints."""
    tolerance: float | None
    """Largest difference that passes, in the column's unit; None where the paper does not determine the number."""
    reason: str
    """Why that much."""


COLUMNS: tuple[Column, ...] = (
    Column(
        table="I",
        quantity="f_error_Hz",
        heading="abs(f-60) Hz",
        digits=2,
        tolerance=0.01,
        reason="the paper prints 0.01 Hz; that is 65 kW of 3900 kW, less than what our loads may differ from its loads",
    ),
    Column(
        table="I",
        quantity="MPSI",
        heading="MPSI",
        digits=2,
        tolerance=0.02,
        reason="the paper prints 0.01, and 0.01 of pu power at each GFL moves it by as much",
    ),
    Column(
        table="II",
        quantity="V_error",
        heading="V_error pu",
        digits=3,
        tolerance=0.003,
        reason="it depends on where loads and capacitors stand, which the paper does not print",
    ),
    Column(
        table="II",
        quantity="MQSI",
        heading="MQSI",
        digits=2,
        tolerance=None,
        reason="circulating vars depend on the places of inverters and capacitors, which the paper does not print; "
        "what the paper claims of it is the order of the cases and the distance between them",
    ),
)
"""Columns of Tables I and II."""

ISLANDING: dict[str, dict[str, dict[Quantity, float]]] = {
    case: {
        event: dict(zip(("f_error_Hz", "MPSI", "V_error", "MQSI"), numbers, strict=True))
        for event, numbers in (("event1", event1), ("event2", event2))
    }
    for case, event1, event2 in (
        ("I", (0.14, 0.00, 0.015, 0.22), (0.07, 0.00, 0.006, 0.30)),
        ("II", (0.08, 0.12, 0.001, 2.03), (0.00, 0.24, 0.000, 1.66)),
        ("III", (0.08, 0.12, 0.002, 1.77), (0.00, 0.24, 0.002, 1.07)),
        ("IV", (0.00, 0.00, 0.002, 0.04), (0.00, 0.00, 0.001, 0.05)),
    )
}
"""Tables I and II: by case, event and quantity."""
