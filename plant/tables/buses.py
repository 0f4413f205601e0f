"""The buses of a feeder, and what every other table asks about them."""

from __future__ import annotations

from collections.abc import Container, Iterable
from math import sqrt
from pathlib import Path
from typing import Any

from gridpeers.plant.equipment import PHASES, Bus, Feeder
from gridpeers.plant.equipment.connectivity import Connectivity, Node, by_bus
from gridpeers.plant.tables.csv_table import C, CsvRow, CsvTable
from gridpeers.plant.tables.feeder_columns import BusColumns, ImportedBusColumns
from gridpeers.wire.wording import first_of, suggestion

_SHOWN = 24  # so many buses that are cut off are named


class BusTable:
    """Reads buses.csv and checks references to buses; the other tables come from its folder, with its problems."""

    def __init__(self, folder: Path, problems: list[str]) -> None:
        self._folder, self.problems = folder, problems
        self.imported = (folder / "elements.csv").is_file()
        """Whether the feeder comes from another program: it then needs no lines of our own."""
        self._by_name: dict[str, Bus] = {}
        self._row_of: dict[str, CsvRow[BusColumns]] = {}
        table = self.table("buses.csv", ImportedBusColumns if self.imported else BusColumns, required=True)
        self._readable = table.readable and len(table) > 0
        if table.readable and not len(table):
            problems.append("buses.csv: has no rows; a feeder needs at least one bus")
        for row in table:
            it = row.columns
            name, V_nom = it.bus, it.V_nom_kV_LL * 1000.0 / sqrt(3.0)
            bus = Bus(name=name, phases=it.phases, V_nom=V_nom, zone=it.zone, x=it.x, y=it.y)
            if row.is_new("bus", name, self._by_name) and name:
                self._by_name[name] = bus
                self._row_of[name] = row
        self.rows = tuple(self._by_name.values())
        self.floating: set[str] = set()

    def table(self, file: str, columns: type[C], *, required: bool = False) -> CsvTable[C]:
        return CsvTable(self._folder, file, columns, self.problems, required=required)

    def find(self, row: CsvRow[Any], column: str = "bus") -> Bus | None:
        return self.named(row, column, getattr(row.columns, column))

    def named(self, row: CsvRow[Any], column: str, name: str) -> Bus | None:
        """Return the bus of a name that stands in a column; None, and a problem noted, if there is no such bus."""
        bus = self._by_name.get(name)
        if name and bus is None and self._readable:
            row.problem(f'{column} "{name}": no such bus; {suggestion(name, self._by_name, "buses")}')
        return bus

    def find_ends(self, row: CsvRow[Any], phases: str) -> tuple[Bus, Bus] | None:
        """Read the two ends of a branch that carries `phases`."""
        ends = self.find(row, "from_bus"), self.find(row, "to_bus")
        for bus in dict.fromkeys(ends):
            if bus is not None:
                require_phases(row, bus, phases)
        if ends[0] is None or ends[1] is None:
            return None
        if ends[0].name == ends[1].name:
            row.problem(f'both ends are bus "{ends[0].name}"; a branch needs two buses')
            return None
        return ends[0], ends[1]

    def require_equal_voltage(self, row: CsvRow[Any], ends: tuple[Bus, Bus], what: str) -> None:
        """Note a problem if something that is no transformer joins two nominal voltages."""
        V_from, V_to = (bus.V_nom * sqrt(3.0) / 1000.0 for bus in ends)
        if abs(V_from - V_to) > 1e-6 * V_from:
            row.problem(
                f"a {what} between buses of {V_from:g} kV and {V_to:g} kV; "
                f"it joins equal nominal voltages only, use transformers.csv"
            )

    def mark_floating(self, names: Iterable[str]) -> None:
        """Note that buses stand behind a delta winding, where no current can return through ground."""
        self.floating.update(names)

    def require_ground(self, row: CsvRow[Any], bus: Bus, what: str) -> bool:
        return require_ground(row, bus, what, self.floating)

    def row_of(self, name: str) -> CsvRow[BusColumns]:
        return self._row_of[name]


def require_phases(row: CsvRow[Any], bus: Bus, phases: Iterable[str]) -> bool:
    """Note a problem if the bus lacks one of the phases; return whether it has all."""
    missing = [phase for phase in phases if phase not in bus.phases]
    if missing:
        row.problem(f'bus "{bus.name}" has no phase {", ".join(missing)}; it has {bus.phases}')
    return not missing


def require_ground(row: CsvRow[Any], bus: Bus, what: str, floating: Container[str]) -> bool:
    """Note a problem if something connected to ground stands behind a delta winding; return whether it does not."""
    if bus.name in floating:
        row.problem(
            f'bus "{bus.name}" stands behind a delta winding without ground, and {what} needs ground; '
            "use delta loads there, or a Yg-Yg transformer"
        )
    return bus.name not in floating


def report_unconnected(feeder: Feeder, buses: BusTable, problems: list[str]) -> None:
    """Note every node that is cut off even with all switches closed: a feeder is one network, in each phase."""
    inverters = (*feeder.inverters, *feeder.spares)
    of_three = [row.bus for row in inverters if len(row.phases) > 1]
    of_three += [bus.name for bus in feeder.buses if set(PHASES) <= set(bus.phases)] if inverters else []
    whole = [*([feeder.source.bus] if feeder.source else []), *of_three][:1]
    parts = Connectivity(feeder).parts(whole=whole)
    main = next((part for part in parts if whole and (whole[0], "A") in part), max(parts, key=len))
    order = {bus.name: bus.phases for bus in feeder.buses}
    for part in by_bus(part for part in parts if part is not main):
        names = [name for name in order if any((name, phase) in part for phase in PHASES)]
        shown = [_named(name, order[name], part) for name in names]
        if len(names) == 1:
            phases = ", ".join(phase for phase in order[names[0]] if (names[0], phase) in part)
            buses.row_of(names[0]).problem(
                f'bus "{names[0]}" phase {phases}: nothing connects it; '
                f"end a line, switch, regulator or transformer there, or remove it"
            )
            continue
        there = [row.name for row in inverters if row.bus in names]
        rest = f"the substation at bus {whole[0]}" if feeder.source else "the rest"
        problems.append(
            f"buses.csv: {len(names)} buses are not connected with {rest}: {first_of(shown, _SHOWN)}"
            + (f" (with {', '.join(there)})" if there else "")
            + "; "
            "a line, switch, regulator or transformer is missing, or lacks a phase"
        )


def _named(bus: str, phases: str, part: frozenset[Node]) -> str:
    """A bus, with its phases if not all of them are in a part."""
    there = [phase for phase in phases if (bus, phase) in part]
    return bus if len(there) == len(phases) else f"{bus} phase {', '.join(there)}"
