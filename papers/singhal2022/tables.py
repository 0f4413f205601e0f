"""The numbers that the paper prints: its Tables I to V, as data. How near ours must come is in `tolerances`.

Singhal, Vu, Du, "Consensus Control for Coordinating Grid-Forming and Grid-Following Inverters in Microgrids",
IEEE Trans. Smart Grid 2022.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from gridpeers.benchmarks import DIGITS, Published, Quantity
from gridpeers.papers.singhal2022.tolerances import MQSI_FACTOR, TABLE, V_RELATIVE, TableNumber, Tolerance


@dataclass(frozen=True, kw_only=True)
class Cell(Published):
    """One number of a table."""

    table: TableNumber

    @property
    def tolerance(self) -> Tolerance:
        """How near ours must come, and why."""
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
        """Whether a number that is not judged by a difference is at most a factor off; None where it is so judged."""
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
    cells: tuple[Cell, ...]

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Its columns, each once."""
        return tuple(dict.fromkeys(cell.quantity for cell in self.cells))


def tables_of(experiment: str) -> tuple[PaperTable, ...]:
    """Return the tables of an experiment, named as in the scenario's key `paper`."""
    return tuple(table for table in TABLES if table.experiment == experiment)


def _table(
    number: TableNumber,
    experiment: str,
    title: str,
    columns: Iterable[tuple[str, Quantity]],
    rows: Mapping[str, Sequence[float]],
    *,
    island: bool = False,
) -> PaperTable:
    """Return a table with a row per case (or per island of case IV) and columns (event, quantity)."""
    places = tuple(columns)
    cells = tuple(
        Cell(
            source=f"Table {number}",
            table=number,
            case="IV" if island else row,
            event=event,
            island=row if island else "",
            quantity=quantity,
            paper=paper,
            digits=3 if (number, quantity) == ("III", "MQSI") else DIGITS[quantity],
            limit=TABLE[number, quantity].value,
        )
        for row, numbers in rows.items()
        for (event, quantity), paper in zip(places, numbers, strict=True)
    )
    return PaperTable(number=number, experiment=experiment, title=title, cells=cells)


def _columns(events: Sequence[str], *quantities: Quantity) -> tuple[tuple[str, Quantity], ...]:
    return tuple((event, quantity) for event in events for quantity in quantities)


_BOTH = ("event1", "event2")

TABLES: tuple[PaperTable, ...] = (
    _table(
        "I",
        "islanding",
        "Frequency and power sharing after islanding and after loss of load",
        _columns(_BOTH, "f_error_Hz", "MPSI"),
        {
            "I": (0.14, 0.00, 0.07, 0.00),
            "II": (0.08, 0.12, 0.00, 0.24),
            "III": (0.08, 0.12, 0.00, 0.24),
            "IV": (0.00, 0.00, 0.00, 0.00),
        },
    ),
    _table(
        "II",
        "islanding",
        "Voltage and var sharing after islanding and after loss of load",
        _columns(_BOTH, "V_error", "MQSI"),
        {
            "I": (0.015, 0.22, 0.006, 0.30),
            "II": (0.001, 2.03, 0.000, 1.66),
            "III": (0.002, 1.77, 0.002, 1.07),
            "IV": (0.002, 0.04, 0.001, 0.05),
        },
    ),
    _table(
        "III",
        "intermittency",
        "Intermittency: available power of inverters 2, 5 and 8",
        _columns(("clouds",), "MPSI", "f_error_Hz", "V_error", "MQSI"),
        {
            "350kW": (0.00, 0.00, 0.002, 0.004),
            "275kW": (0.07, 0.00, 0.002, 0.004),
            "250kW": (0.11, 0.00, 0.002, 0.004),
            "225kW": (0.15, 0.00, 0.002, 0.004),
            "200kW": (0.20, 0.00, 0.002, 0.004),
        },
    ),
    _table(
        "IV",
        "communication",
        "Reduced communication and link failure",
        _columns(("event1",), "f_error_Hz", "MPSI", "V_error", "MQSI"),
        {
            "full": (0.00, 0.00, 0.002, 0.04),
            "reduced": (0.00, 0.00, 0.002, 0.14),
            "link-failure": (0.00, 0.00, 0.002, 0.05),
        },
    ),
    _table(
        "V",
        "switching",
        "Microgrid switching: three islands",
        _columns(("event2",), "f_error_Hz", "MPSI", "V_error", "MQSI"),
        dict.fromkeys(("inv1", "inv4", "inv7"), (0.00, 0.00, 0.000, 0.00)),
        island=True,
    ),
)
"""The paper's tables."""
