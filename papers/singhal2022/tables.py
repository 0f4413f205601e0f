"""The numbers that the paper prints: its Tables I to V, as data. How near ours must come is in `tolerances`.

Singhal, Vu, Du, "Consensus Control for Coordinating Grid-Forming and Grid-Following Inverters in Microgrids",
IEEE Trans. Smart Grid 2022.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from gridpeers.benchmarks import DIGITS, Published, Quantity
from papers.singhal2022.tolerances import MQSI_FACTOR, TABLE, V_RELATIVE, TableNumber, Tolerance


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


def _cells(
    table: TableNumber,
    columns: tuple[tuple[str, Quantity], ...],
    rows: dict[str, tuple[float, ...]],
    island: bool = False,
) -> Iterator[Cell]:
    """Return the cells of a table with a row per case (or per island of case IV) and columns (event, quantity)."""
    for row, numbers in rows.items():
        for (event, quantity), paper in zip(columns, numbers, strict=True):
            digits = 3 if (table, quantity) == ("III", "MQSI") else DIGITS[quantity]
            case, of = ("IV", row) if island else (row, "")
            yield Cell(
                source=f"Table {table}",
                table=table,
                case=case,
                event=event,
                island=of,
                quantity=quantity,
                paper=paper,
                digits=digits,
                limit=TABLE[table, quantity].value,
            )


def _of_events(*quantities: Quantity) -> tuple[tuple[str, Quantity], ...]:
    return tuple((event, quantity) for event in ("event1", "event2") for quantity in quantities)


_ALL: tuple[Quantity, ...] = ("f_error_Hz", "MPSI", "V_error", "MQSI")
_CLOUDS: tuple[tuple[str, Quantity], ...] = tuple(
    ("clouds", quantity) for quantity in ("MPSI", "f_error_Hz", "V_error", "MQSI")
)

TABLES: tuple[PaperTable, ...] = (
    PaperTable(
        number="I",
        experiment="islanding",
        title="Frequency and power sharing after islanding and after loss of load",
        cells=tuple(
            _cells(
                "I",
                _of_events("f_error_Hz", "MPSI"),
                {
                    "I": (0.14, 0.00, 0.07, 0.00),
                    "II": (0.08, 0.12, 0.00, 0.24),
                    "III": (0.08, 0.12, 0.00, 0.24),
                    "IV": (0.00, 0.00, 0.00, 0.00),
                },
            )
        ),
    ),
    PaperTable(
        number="II",
        experiment="islanding",
        title="Voltage and var sharing after islanding and after loss of load",
        cells=tuple(
            _cells(
                "II",
                _of_events("V_error", "MQSI"),
                {
                    "I": (0.015, 0.22, 0.006, 0.30),
                    "II": (0.001, 2.03, 0.000, 1.66),
                    "III": (0.002, 1.77, 0.002, 1.07),
                    "IV": (0.002, 0.04, 0.001, 0.05),
                },
            )
        ),
    ),
    PaperTable(
        number="III",
        experiment="intermittency",
        title="Intermittency: available power of inverters 2, 5 and 8",
        cells=tuple(
            _cells(
                "III",
                _CLOUDS,
                {
                    f"{kW}kW": (MPSI, 0.00, 0.002, 0.004)
                    for kW, MPSI in ((350, 0.00), (275, 0.07), (250, 0.11), (225, 0.15), (200, 0.20))
                },
            )
        ),
    ),
    PaperTable(
        number="IV",
        experiment="communication",
        title="Reduced communication and link failure",
        cells=tuple(
            _cells(
                "IV",
                tuple(("event1", quantity) for quantity in _ALL),
                {
                    "full": (0.00, 0.00, 0.002, 0.04),
                    "reduced": (0.00, 0.00, 0.002, 0.14),
                    "link-failure": (0.00, 0.00, 0.002, 0.05),
                },
            )
        ),
    ),
    PaperTable(
        number="V",
        experiment="switching",
        title="Microgrid switching: three islands",
        cells=tuple(
            _cells(
                "V",
                tuple(("event2", quantity) for quantity in _ALL),
                dict.fromkeys(("inv1", "inv4", "inv7"), (0.00, 0.00, 0.000, 0.00)),
                island=True,
            )
        ),
    ),
)
"""The paper's tables."""
