"""The paper's Tables I to V (tables.toml) with their tolerances, and bounds for its statements without a number."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from gridpeers import Published
from gridpeers.measures import DIGITS, Quantity

TableNumber = Literal["I", "II", "III", "IV", "V"]


class Tolerance(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Tolerance of a column, with its reason."""

    reason: str
    value: float | None = None
    """Largest difference from the paper's number that passes, in its unit; None: no difference fails."""


class PaperTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the paper, as tables.toml has it."""

    experiment: str
    """Key `paper` of our scenario that reproduces the table."""
    title: str
    events: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    rows: dict[str, list[float]]
    """By case, or by island of case IV: the quantities after each event."""
    tolerances: dict[Quantity, Tolerance]
    islands: bool = False

    @property
    def number(self) -> TableNumber:
        return next(number for number, table in _TABLES.items() if table is self)

    @property
    def cells(self) -> tuple[Cell, ...]:
        places = [(event, quantity) for event in self.events for quantity in self.quantities]
        return tuple(
            Cell(
                source=f"Table {self.number}",
                table=self.number,
                case="IV" if self.islands else row,
                event=event,
                island=row if self.islands else "",
                quantity=quantity,
                paper=paper,
                digits=3 if (self.number, quantity) == ("III", "MQSI") else DIGITS[quantity],
                limit=self.tolerances[quantity].value,
            )
            for row, numbers in self.rows.items()
            for (event, quantity), paper in zip(places, numbers, strict=True)
        )


_TABLES = msgspec.toml.decode(Path(__file__).with_name("tables.toml").read_bytes(), type=dict[TableNumber, PaperTable])
TABLES = tuple(_TABLES.values())

TABLE = {(number, quantity): it for number, table in _TABLES.items() for quantity, it in table.tolerances.items()}
"""Tolerances by table and quantity."""


def tables_of(experiment: str) -> tuple[PaperTable, ...]:
    """Return the tables of an experiment, named as in the scenario's key `paper`."""
    return tuple(table for table in TABLES if table.experiment == experiment)


V_RELATIVE = 0.25
"""Part of the paper's V_error by which ours may differ, or half of the last digit if that is more. Rounding hides as
much of 0.002, the most frequent value. A zero passes the table's bound of 0.003 pu, but not this one."""
MQSI_FACTOR = 2.0
"""An MQSI is near the paper's if neither is more than this factor times the other. It depends on the places of loads,
inverters and capacitors, which the paper does not print."""

WITHIN = 1.0  # s; the paper: "in less than 1 s"
F_NONE = 0.01  # Hz; the smallest residual in Table I beside 0 is 0.07 Hz
IV_MQSI = 0.1  # twice what Table II has for case IV, 0.05
FIVE_TIMES = 5.0  # the paper: "more than 5 times"
IDLE = 0.01  # pu; power of a GFL that counts as unchanged: reading accuracy of the paper's figure of P
AT_ONCE = 0.1  # s; the GFM take a lost inverter's load in one step of the network, then all by droop
EQUAL = 0.01  # pu; powers that count as equal: reading accuracy of the paper's figures of P
V_FIGURE = 0.01  # pu; voltage that counts as restored: reading accuracy of the paper's figure of V
AT_LIMIT = 0.005  # pu of rating; power of a saturated GFL off its limit: the ripple of its current controller
HEADROOM_GONE = 0.1  # Hz; clearly not restored: 10 % of the range of droop
MQSI_UNMOVED = 0.005  # the paper prints 0.004 in all columns
REDUCED_MQSI = 0.2  # the paper has 0.14 after tuning on its own feeder
SLOWER_LEAST = 0.25  # s; half of the paper's "about 0.5 s"
SLOWER_MOST = 1.0  # s; twice the paper's "about 0.5 s"
SAME_END = 0.002  # steady f (Hz) and MPSI that count as the same over graphs: a fifth of what Table I prints
FEW_LINKS = 12  # links; where the paper's figure bends
STEEPER = 2.0  # least ratio of a sharp slope to a slow one
SAME_V = 0.0005  # pu; V_error that counts as the same: half of the last digit that the paper prints


@dataclass(frozen=True, kw_only=True)
class Cell(Published):
    """One number of a table."""

    table: TableNumber

    @property
    def tolerance(self) -> Tolerance:
        return TABLE[self.table, self.quantity]

    @property
    def relative(self) -> float | None:
        """Largest difference in proportion to the number's size; None for all but V_error.

        It is at least half of the last digit that the paper prints: its 0.000 means a value below 0.0005.
        """
        if self.quantity != "V_error":
            return None
        return max(V_RELATIVE * self.paper, 0.5 * 10.0**-self.digits)

    def within_relative(self, ours: float) -> bool | None:
        """Return whether our number is near enough in proportion to its size; None where that is not judged."""
        return None if self.relative is None else abs(ours - self.paper) <= self.relative

    def within_factor(self, ours: float) -> bool | None:
        """Return whether a number without a tolerance is at most a factor off; None where there is a tolerance."""
        if self.tolerance.value is not None:
            return None
        return self.paper / MQSI_FACTOR <= ours <= self.paper * MQSI_FACTOR
