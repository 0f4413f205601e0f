"""The paper's Tables I to V (tables.toml) with their tolerances, and bounds for what it says without a number."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from gridpeers import Published
from gridpeers.measures import DIGITS, Quantity

TableNumber = Literal["I", "II", "III", "IV", "V"]


class Tolerance(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How near a column of ours must come."""

    reason: str
    value: float | None = None
    """Largest difference from the paper's number that passes, in its unit; None where nothing is judged by it."""


class _Source(msgspec.Struct, forbid_unknown_fields=True):
    """A table as tables.toml has it."""

    experiment: str
    title: str
    events: list[str]
    quantities: list[Quantity]
    rows: dict[str, list[float]]
    """By case, or by island of case IV: the quantities after each event."""
    tolerances: dict[Quantity, Tolerance]
    islands: bool = False


_SOURCES = msgspec.toml.decode(Path(__file__).with_name("tables.toml").read_bytes(), type=dict[TableNumber, _Source])

TABLE: dict[tuple[TableNumber, Quantity], Tolerance] = {
    (number, quantity): tolerance
    for number, table in _SOURCES.items()
    for quantity, tolerance in table.tolerances.items()
}
"""Tolerances by table and quantity."""


@dataclass(frozen=True)
class Bound:
    """A bound on our own number, where the paper says a sentence and no number that could be compared."""

    value: float
    """The bound, in the unit that its reason names."""
    reason: str


V_RELATIVE = Bound(
    0.25,
    "of the paper's number, which is what printing hides of the 0.002 that it prints most often, or half of its last "
    "digit: a zero passes a bound of 0.003 pu, and not this one (1)",
)
MQSI_FACTOR = Bound(
    2.0,
    "how many times an MQSI may be the paper's, or the paper's it, to count as near: it depends on where loads, "
    "inverters and capacitors stand, which the paper does not print",
)

WITHIN = Bound(1.0, 'the paper: "in less than 1 s" (s)')
F_NONE = Bound(0.01, "half of the smallest residual that is not 0 in Table I is far above it (Hz)")
IV_MQSI = Bound(0.1, "twice what Table II has for case IV, 0.05")
FIVE_TIMES = Bound(5.0, 'the paper: "more than 5 times" (1)')
IDLE = Bound(0.01, "power of a GFL that counts as unchanged (pu): what the paper's figure of P can be read to")
AT_ONCE = Bound(0.1, "the GFM take a lost inverter's load in one step of the network, then all by droop (s)")
EQUAL = Bound(0.01, "powers that count as equal (pu): what the paper's figures of P can be read to")
V_FIGURE = Bound(0.01, "voltage that counts as restored (pu): what the paper's figure of V can be read to")
AT_LIMIT = Bound(0.005, "power of a saturated GFL off its limit (pu of rating): the ripple of its current controller")
HEADROOM_GONE = Bound(0.1, "frequency error that is no restoration by any reading (Hz): 10 % of the range of droop")
MQSI_UNMOVED = Bound(0.005, "the paper prints 0.004 in all columns: what moves less rounds to nearly the same")
REDUCED_MQSI = Bound(0.2, "the paper has 0.14 after tuning on its own feeder; issue 5's bound (1)")
SLOWER_LEAST = Bound(0.25, 'half of the paper\'s "about 0.5 s" (s)')
SLOWER_MOST = Bound(1.0, 'twice the paper\'s "about 0.5 s" (s)')
SAME_END = Bound(0.002, "steady f (Hz) and MPSI that count as the same over graphs: a fifth of what Table I prints")
FEW_LINKS = Bound(12, "where the paper's figure bends (links)")
STEEPER = Bound(2.0, "how many times steeper a slope must be to be called sharp beside another (1)")
SAME_V = Bound(0.0005, "V_error that counts as the same (pu): half of the last digit that the paper prints")


@dataclass(frozen=True, kw_only=True)
class Cell(Published):
    """One number of a table."""

    table: TableNumber

    @property
    def tolerance(self) -> Tolerance:
        return TABLE[self.table, self.quantity]

    @property
    def relative(self) -> float | None:
        """Largest difference beside the number's own size; None for all but V_error.

        It is no less than half of the last digit that the paper prints: its 0.000 stands for all below 0.0005.
        """
        if self.quantity != "V_error":
            return None
        return max(V_RELATIVE.value * self.paper, 0.5 * 10.0**-self.digits)

    def within_relative(self, ours: float) -> bool | None:
        """Return whether our number is near enough beside its own size; None where that is not judged."""
        return None if self.relative is None else abs(ours - self.paper) <= self.relative

    def within_factor(self, ours: float) -> bool | None:
        """Return whether a number without a tolerance is at most a factor off; None where there is a tolerance."""
        if self.tolerance.value is not None:
            return None
        return self.paper / MQSI_FACTOR.value <= ours <= self.paper * MQSI_FACTOR.value


@dataclass(frozen=True, kw_only=True)
class PaperTable:
    """A table of the paper, with our experiment that has its numbers."""

    number: TableNumber
    experiment: str
    """Key `paper` of its scenario."""
    title: str
    quantities: tuple[Quantity, ...]
    cells: tuple[Cell, ...]


def _table(number: TableNumber, source: _Source) -> PaperTable:
    places = [(event, quantity) for event in source.events for quantity in source.quantities]
    cells = tuple(
        Cell(
            source=f"Table {number}",
            table=number,
            case="IV" if source.islands else row,
            event=event,
            island=row if source.islands else "",
            quantity=quantity,
            paper=paper,
            digits=3 if (number, quantity) == ("III", "MQSI") else DIGITS[quantity],
            limit=TABLE[number, quantity].value,
        )
        for row, numbers in source.rows.items()
        for (event, quantity), paper in zip(places, numbers, strict=True)
    )
    return PaperTable(
        number=number,
        experiment=source.experiment,
        title=source.title,
        quantities=tuple(source.quantities),
        cells=cells,
    )


TABLES = tuple(_table(number, source) for number, source in _SOURCES.items())


def tables_of(experiment: str) -> tuple[PaperTable, ...]:
    """Return the tables of an experiment, named as in the scenario's key `paper`."""
    return tuple(table for table in TABLES if table.experiment == experiment)
