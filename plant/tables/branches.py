"""Tables of the buses, and of what lies between two of them: lines, switches, regulators, transformers, elements."""

from __future__ import annotations

import math
from cmath import isfinite
from collections.abc import Container, Iterable
from dataclasses import replace
from math import sqrt
from pathlib import Path
from typing import Any

from gridpeers.plant.equipment import PHASES, Bus, Line, LineConfig, Regulator, Switch, Transformer
from gridpeers.plant.equipment.imported_equipment import LinearElement
from gridpeers.plant.tables import feeder_columns as columns
from gridpeers.plant.tables.csv_table import C, CsvRow, CsvTable
from gridpeers.wire.wording import suggestion

Matrix = tuple[tuple[Any, ...], ...]


class BusTable:
    """The buses of a feeder, and references to them; the other tables come from its folder, with its problems.

    `imported`: whether the feeder comes from another program, so that it needs no lines of our own; `floating`: buses
    behind a delta winding, where no current can return through ground.
    """

    def __init__(self, folder: Path, problems: list[str]) -> None:
        self._folder, self.problems = folder, problems
        self.imported = (folder / "elements.csv").is_file()
        self.floating: frozenset[str] = frozenset()
        self._by_name: dict[str, Bus] = {}
        kind = columns.ImportedBusColumns if self.imported else columns.BusColumns
        table = self.table("buses.csv", kind, required=True)
        self._readable = table.readable and len(table) > 0
        if table.readable and not len(table):
            problems.append("buses.csv: has no rows; a feeder needs at least one bus")
        for row in table:
            it = row.columns
            if row.is_new("bus", it.bus, self._by_name) and it.bus:
                V_nom = it.V_nom_kV_LL * 1000.0 / sqrt(3.0)
                self._by_name[it.bus] = Bus(name=it.bus, phases=it.phases, V_nom=V_nom, zone=it.zone, x=it.x, y=it.y)
        self.rows = tuple(self._by_name.values())

    def table(self, file: str, kind: type[C], *, required: bool = False) -> CsvTable[C]:
        return CsvTable(self._folder, file, kind, self.problems, required=required)

    def find(self, row: CsvRow[Any], column: str = "bus", name: str | None = None) -> Bus | None:
        """Return the bus that a column names; None, and a problem noted, if there is no such bus."""
        name = getattr(row.columns, column) if name is None else name
        bus = self._by_name.get(name)
        if name and bus is None and self._readable:
            row.problem(f'{column} "{name}": no such bus; {suggestion(name, self._by_name, "buses")}')
        return bus

    def find_ends(self, row: CsvRow[Any], phases: str, what: str = "") -> tuple[Bus, Bus] | None:
        """Return the two ends of a branch that carries `phases`; `what` it is if it joins equal voltages only."""
        ends = self.find(row, "from_bus"), self.find(row, "to_bus")
        for bus in dict.fromkeys(ends):
            if bus is not None:
                require_phases(row, bus, phases)
        if ends[0] is None or ends[1] is None:
            return None
        if ends[0].name == ends[1].name:
            row.problem(f'both ends are bus "{ends[0].name}"; a branch needs two buses')
            return None
        V_from, V_to = (bus.V_nom * sqrt(3.0) / 1000.0 for bus in (ends[0], ends[1]))
        if what and abs(V_from - V_to) > 1e-6 * V_from:
            row.problem(
                f"a {what} between buses of {V_from:g} kV and {V_to:g} kV; it joins only equal nominal voltages; use "
                "transformers.csv"
            )
        return ends[0], ends[1]


def require_phases(row: CsvRow[Any], bus: Bus, phases: Iterable[str]) -> bool:
    """Note a problem if the bus lacks one of the phases; return whether it has all."""
    missing = [phase for phase in phases if phase not in bus.phases]
    if missing:
        row.problem(f'bus "{bus.name}" has no phase {", ".join(missing)}; it has {bus.phases}')
    return not missing


def require_ground(row: CsvRow[Any], bus: Bus, what: str, floating: Container[str]) -> None:
    """Note a problem if something connected to ground is behind a delta winding."""
    if bus.name in floating:
        row.problem(
            f'bus "{bus.name}" is behind a delta winding without ground, and {what} needs ground; use delta loads '
            "there, or a Yg-Yg transformer"
        )


def read_line_configs(buses: BusTable) -> dict[str, LineConfig] | None:
    """Read line_configs.csv: the upper triangles of the matrices, one element per row. None if it is unreadable."""
    elements: dict[str, dict[tuple[str, str], tuple[complex, float]]] = {}
    last_row: dict[str, CsvRow[columns.LineConfigColumns]] = {}
    mistaken: set[str] = set()
    spoiled: set[str] = set()  # an element's place is unknown, so none can be called missing
    table = buses.table("line_configs.csv", columns.LineConfigColumns, required=not buses.imported)
    for row in table:
        it, misplaced = row.columns, not row.wrong.isdisjoint(("config", "phase_1", "phase_2"))
        name, place = it.config, (it.phase_1, it.phase_2)
        diagonal = it.phase_1 == it.phase_2 and not misplaced
        row.require("R_ohm_per_km", columns.SELF_R if diagonal else columns.MUTUAL)
        row.require("X_ohm_per_km", columns.SELF_X if diagonal else columns.MUTUAL)
        row.require("B_uS_per_km", columns.SELF_B if diagonal else columns.MUTUAL_B)
        matrix = elements.setdefault(name, {})
        if misplaced:
            spoiled.add(name)
            continue
        if place in matrix:
            row.problem(f'config "{name}" element {"-".join(place)}: given already; give each element once')
        if row.wrong or place in matrix:
            mistaken.add(name)
        matrix[place] = matrix[place[::-1]] = complex(it.R_ohm_per_km, it.X_ohm_per_km), it.B_uS_per_km * 1e-6
        last_row[name] = row
    configs: dict[str, LineConfig] = {}
    for name, matrix in elements.items():
        phases = "".join(phase for phase in PHASES if any(phase in pair for pair in matrix))
        missing = [f"{a}-{b}" for a in phases for b in phases if a <= b and (a, b) not in matrix]
        if missing and name not in spoiled:
            last_row[name].problem(f'config "{name}" lacks element {", ".join(missing)}; give the whole upper triangle')
        rows = [[matrix.get((a, b), (0j, 0.0)) for b in phases] for a in phases]
        Z = tuple(tuple(z for z, _ in row) for row in rows)
        B = tuple(tuple(susceptance for _, susceptance in row) for row in rows)
        configs[name] = LineConfig(name=name, phases=phases, Z=Z, B=B)
        if missing or name in spoiled | mistaken:
            continue
        for what, part in (("an R", lambda z: z.real), ("an X", lambda z: z.imag)):
            if not _positive_definite(tuple(tuple(map(part, row)) for row in Z)):
                last_row[name].problem(
                    f'config "{name}" has {what} matrix that no line has (not positive definite); the elements off '
                    "the diagonal must be smaller than those on it"
                )
    return configs if table.readable else None


def read_lines(buses: BusTable, configs: dict[str, LineConfig] | None) -> tuple[Line, ...]:
    lines: dict[str, Line] = {}
    for row in buses.table("lines.csv", columns.LineColumns, required=not buses.imported):
        it, name, config, phases = row.columns, row.columns.line, row.columns.config, row.columns.phases
        ends = buses.find_ends(row, phases, "line")
        if configs is None or not config:
            pass
        elif config not in configs:
            hint = suggestion(config, configs, "line configurations")
            row.problem(f'config "{config}": no such line configuration; {hint}')
        elif not set(phases) <= set(configs[config].phases):
            row.problem(f'config "{config}" is for phases {configs[config].phases}, the line carries {phases}')
        if row.is_new("line", name, lines) and ends:
            one, other, length = it.from_bus, it.to_bus, it.length_m / 1000.0
            lines[name] = Line(name=name, from_bus=one, to_bus=other, phases=phases, config=config, length=length)
    return tuple(lines.values())


def read_switches(buses: BusTable) -> tuple[Switch, ...]:
    """Read switches.csv; a switch is named by its buses ("13-152"), column alias may give a second name."""
    switches: list[Switch] = []
    names: set[str] = set()
    for row in buses.table("switches.csv", columns.SwitchColumns):
        it, phases = row.columns, row.columns.phases
        one, other, closed = it.from_bus, it.to_bus, it.state == "closed"
        if not buses.find_ends(row, phases, "switch"):
            continue
        switch = Switch(name=f"{one}-{other}", alias=it.alias, from_bus=one, to_bus=other, phases=phases, closed=closed)
        for text in (switch.name, switch.alias):
            row.is_new("switch", text, names)
        names.update(switch.names)
        switches.append(switch)
    return tuple(switches)


def read_regulators(buses: BusTable) -> tuple[Regulator, ...]:
    regulators: list[Regulator] = []
    seen: set[tuple[str, str]] = set()
    for row in buses.table("regulators.csv", columns.RegulatorColumns):
        it, name, phases = row.columns, row.columns.regulator, row.columns.phases
        ends = buses.find_ends(row, phases, "regulator")
        ratio = 1.0 + it.tap * it.tap_step_pu
        if not math.isnan(ratio) and (text := columns.RATIO.objection(ratio)):
            row.problem(f"tap, tap_step_pu: {text}")
        for phase in [phase for phase in phases if (name, phase) in seen]:
            row.problem(f'regulator "{name}" phase {phase}: given already; give each phase once')
        seen |= {(name, phase) for phase in phases}
        if ends:
            regulators.append(Regulator(name=name, from_bus=it.from_bus, to_bus=it.to_bus, phases=phases, ratio=ratio))
    return tuple(regulators)


def read_transformers(buses: BusTable) -> tuple[Transformer, ...]:
    transformers: dict[str, Transformer] = {}
    for row in buses.table("transformers.csv", columns.TransformerColumns):
        it, name = row.columns, row.columns.transformer
        ends = buses.find_ends(row, "ABC")
        if ends:
            V_nom = min(end.V_nom for end in ends)
            most = columns.power_of("a transformer", V_nom, columns.RATED_CURRENT, 3)
            row.require("S_rated_kVA", replace(most, low=1.0))
        if row.is_new("transformer", name, transformers) and ends:
            transformers[name] = Transformer(
                name=name,
                from_bus=it.from_bus,
                to_bus=it.to_bus,
                connection=it.connection,
                S_rated=it.S_rated_kVA * 1000.0,
                z=complex(it.R_percent, it.X_percent) / 100.0,
            )
    return tuple(transformers.values())


def read_elements(buses: BusTable) -> tuple[LinearElement, ...]:
    elements: dict[str, LinearElement] = {}
    for row in buses.table("elements.csv", columns.ElementColumns):
        it = row.columns
        nodes = [_node(row, text, buses) for text in it.nodes.split()]
        Y = _matrix(row, it.Y_S, len(nodes))
        if row.is_new("element", it.element, elements) and Y is not None and all(nodes):
            elements[it.element] = LinearElement(name=it.element, nodes=tuple(filter(None, nodes)), Y=Y)
    return tuple(elements.values())


def _node(row: CsvRow[Any], text: str, buses: BusTable) -> tuple[str, str] | None:
    """Return the node that "650.A" names; None, and a problem noted, if there is none."""
    name, _, phase = text.rpartition(".")
    if not name or len(phase) != 1:
        row.problem(f'nodes: "{text}" is no node; write a bus and one of its phases, as "650.A"')
        return None
    bus = buses.find(row, "nodes", name)
    return (name, phase) if bus is not None and require_phases(row, bus, phase) else None


def _matrix(row: CsvRow[Any], text: str, n: int) -> Matrix | None:
    """Return a square matrix of n rows; None, and a problem noted, if the text is none."""
    try:
        values = [complex(value) for value in text.split()]
    except ValueError as error:
        row.problem(f"Y_S: {error}; numbers are written as 1.5-2.5j")
        return None
    if len(values) != n * n or not all(map(isfinite, values)):
        row.problem(f"Y_S: has {len(values)} numbers; {n} nodes need {n} times {n}, all finite")
        return None
    return tuple(tuple(values[i * n : (i + 1) * n]) for i in range(n))


def _positive_definite(matrix: Matrix) -> bool:
    """Return whether a symmetric matrix of up to three rows is positive definite, by its leading minors."""
    (a, *ab), rest = matrix[0], matrix[1:]
    if a <= 0.0:
        return False
    schur = tuple(tuple(x - row[0] * ab[k] / a for k, x in enumerate(row[1:])) for row in rest)
    return not schur or _positive_definite(schur)
