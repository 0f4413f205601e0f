"""The buses of a feeder, and what every other table asks about them."""

from __future__ import annotations

from collections.abc import Iterable
from math import sqrt
from pathlib import Path

from plant.equipment import PHASES, Bus, Feeder, Line, Regulator, Switch
from plant.tables.table import Row, Table
from wire.nearest import suggestion


class BusTable:
    """Reads buses.csv and checks references to buses.

    Attributes
    ----------
    rows : tuple of Bus
        The buses, in the table's order.
    """

    def __init__(self, folder: Path, mistakes: list[str]) -> None:
        self._by_name: dict[str, Bus] = {}
        self._row_of: dict[str, Row] = {}
        table = Table(folder, "buses.csv", ("bus", "phases", "V_nom_kV_LL"), mistakes, required=True)
        self._readable = table.readable
        for row in table:
            name = row.text("bus")
            bus = Bus(
                name=name,
                phases=row.phases(stand_in="ABC"),
                V_nom=row.number("V_nom_kV_LL", above=0.0) * 1000.0 / sqrt(3.0),
                zone=row.text("zone", default=""),
                x=row.number("x") if row.text("x", default="") else 0.0,
                y=row.number("y") if row.text("y", default="") else 0.0,
            )
            if name in self._by_name:
                row.mistake(f'bus "{name}": there is one of this name already; names must differ')
            elif name:
                self._by_name[name] = bus
                self._row_of[name] = row
        self.rows = tuple(self._by_name.values())
        self._floating: set[str] = set()

    def find(self, row: Row, column: str = "bus") -> Bus | None:
        """Read a reference to a bus; None, and a mistake noted, if there is no such bus."""
        name = row.text(column)
        bus = self._by_name.get(name)
        if name and bus is None and self._readable:
            row.mistake(f'{column} "{name}": no such bus; {suggestion(name, self._by_name, "buses")}')
        return bus

    def find_ends(self, row: Row, phases: str) -> tuple[Bus, Bus] | None:
        """Read the two ends of a branch that carries `phases`."""
        ends = self.find(row, "from_bus"), self.find(row, "to_bus")
        for bus in dict.fromkeys(ends):
            if bus is not None:
                self.require_phases(row, bus, phases)
        if ends[0] is None or ends[1] is None:
            return None
        if ends[0].name == ends[1].name:
            row.mistake(f'both ends are bus "{ends[0].name}"; a branch needs two buses')
            return None
        return ends[0], ends[1]

    def require_phases(self, row: Row, bus: Bus, phases: Iterable[str]) -> bool:
        """Note a mistake if the bus lacks one of the phases; tell whether all is well."""
        missing = [phase for phase in phases if phase not in bus.phases]
        if missing:
            row.mistake(f'bus "{bus.name}" has no phase {", ".join(missing)}; it has {bus.phases}')
        return not missing

    def require_equal_voltage(self, row: Row, ends: tuple[Bus, Bus], what: str) -> None:
        """Note a mistake if something that is no transformer joins two nominal voltages."""
        V_from, V_to = (bus.V_nom * sqrt(3.0) / 1000.0 for bus in ends)
        if abs(V_from - V_to) > 1e-6 * V_from:
            row.mistake(
                f"a {what} between buses of {V_from:g} kV and {V_to:g} kV; "
                f"it joins equal nominal voltages only, use transformers.csv"
            )

    def mark_floating(self, bus: Bus) -> None:
        """Note that a bus stands behind a delta winding, where no current can return through ground."""
        self._floating.add(bus.name)

    def require_ground(self, row: Row, bus: Bus, what: str) -> None:
        """Note a mistake if something connected to ground stands behind a delta winding."""
        if bus.name in self._floating:
            row.mistake(
                f'bus "{bus.name}" stands behind a delta winding without ground, and {what} needs ground; '
                f"use delta loads there, or a Yg-Yg transformer"
            )

    def row_of(self, name: str) -> Row:
        """Give the table's row of a bus, to note a mistake there."""
        return self._row_of[name]


def report_unconnected(feeder: Feeder, buses: BusTable, mistakes: list[str]) -> None:
    """Note every phase of a bus that no branch, switch or source touches: an inverter there would feed nothing."""
    branches: list[Line | Switch | Regulator] = [*feeder.lines, *feeder.switches, *feeder.regulators]
    touched = {
        (end, phase) for branch in branches for end in (branch.from_bus, branch.to_bus) for phase in branch.phases
    }
    whole = [end for transformer in feeder.transformers for end in (transformer.from_bus, transformer.to_bus)]
    if len(feeder.buses) == 1:  # what feeds the only bus is enough
        whole += [inverter.bus for inverter in feeder.inverters]
    whole += [feeder.source.bus] if feeder.source else []
    touched |= {(bus, phase) for bus in whole for phase in PHASES}
    for bus in feeder.buses:
        alone = [phase for phase in bus.phases if (bus.name, phase) not in touched]
        if alone:
            buses.row_of(bus.name).mistake(
                f'bus "{bus.name}" phase {", ".join(alone)}: nothing connects it; '
                f"end a line, switch, regulator or transformer there, or remove it"
            )
