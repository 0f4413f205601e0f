"""Tables of what lies between two buses: lines and their configurations, switches, regulators, transformers."""

from __future__ import annotations

import math
from dataclasses import replace

from gridpeers.plant.equipment import PHASES, Line, LineConfig, Regulator, Switch, Transformer
from gridpeers.plant.tables.buses import BusTable
from gridpeers.plant.tables.csv_table import CsvRow
from gridpeers.plant.tables.feeder_columns import (
    MUTUAL,
    MUTUAL_B,
    RATED_CURRENT,
    RATIO,
    SELF_B,
    SELF_R,
    SELF_X,
    LineColumns,
    LineConfigColumns,
    RegulatorColumns,
    SwitchColumns,
    TransformerColumns,
    power_of,
)
from gridpeers.wire.wording import suggestion


def read_line_configs(buses: BusTable) -> dict[str, LineConfig] | None:
    """Read line_configs.csv: the upper triangles of the matrices, one element per row. None if it is unreadable."""
    elements: dict[str, dict[tuple[str, str], tuple[complex, float]]] = {}
    last_row: dict[str, CsvRow[LineConfigColumns]] = {}
    mistaken: dict[str, bool] = {}
    spoiled: set[str] = set()  # an element's place is unknown, so none can be called missing
    table = buses.table("line_configs.csv", LineConfigColumns, required=not buses.imported)
    for row in table:
        it, misplaced = row.columns, not row.wrong.isdisjoint(("config", "phase_1", "phase_2"))
        name, first, second = it.config, it.phase_1, it.phase_2
        diagonal = first == second and not misplaced
        row.require("R_ohm_per_km", SELF_R if diagonal else MUTUAL)
        row.require("X_ohm_per_km", SELF_X if diagonal else MUTUAL)
        row.require("B_uS_per_km", SELF_B if diagonal else MUTUAL_B)
        R, X, B = it.R_ohm_per_km, it.X_ohm_per_km, it.B_uS_per_km * 1e-6
        matrix = elements.setdefault(name, {})
        if misplaced:
            spoiled.add(name)
            continue
        if (first, second) in matrix:
            row.problem(f'config "{name}" element {first}-{second}: given already; give each element once')
        matrix[first, second] = matrix[second, first] = (complex(R, X), B)
        last_row[name] = row
        mistaken[name] = mistaken.get(name, False) or row.mistaken
    configs: dict[str, LineConfig] = {}
    for name, matrix in elements.items():
        phases = "".join(phase for phase in PHASES if any(phase in pair for pair in matrix))
        missing = [f"{a}-{b}" for a in phases for b in phases if a <= b and (a, b) not in matrix]
        if missing and name not in spoiled:
            last_row[name].problem(f'config "{name}" lacks element {", ".join(missing)}; give the whole upper triangle')
        blank = (0j, 0.0)
        Z = tuple(tuple(matrix.get((a, b), blank)[0] for b in phases) for a in phases)
        B_matrix = tuple(tuple(matrix.get((a, b), blank)[1] for b in phases) for a in phases)
        configs[name] = LineConfig(name=name, phases=phases, Z=Z, B=B_matrix)
        if missing or name in spoiled or mistaken[name]:
            continue
        for what, part in (("an R", lambda z: z.real), ("an X", lambda z: z.imag)):
            if not _positive_definite(tuple(tuple(map(part, row)) for row in Z)):
                last_row[name].problem(
                    f'config "{name}" has {what} matrix that no line has (not positive definite); the elements off '
                    "the diagonal must be smaller than those on it"
                )
    return configs if table.readable else None


def read_lines(buses: BusTable, configs: dict[str, LineConfig] | None) -> tuple[Line, ...]:
    """Read lines.csv; lengths in m."""
    lines: dict[str, Line] = {}
    for row in buses.table("lines.csv", LineColumns, required=not buses.imported):
        name, config, phases = row.columns.line, row.columns.config, row.columns.phases
        ends = buses.find_ends(row, phases)
        if configs is None or not config:
            pass
        elif config not in configs:
            row.problem(
                f'config "{config}": no such line configuration; {suggestion(config, configs, "line configurations")}'
            )
        elif not set(phases) <= set(configs[config].phases):
            row.problem(f'config "{config}" is for phases {configs[config].phases}, the line carries {phases}')
        if row.is_new("line", name, lines) and ends:
            buses.require_equal_voltage(row, ends, "line")
            lines[name] = Line(
                name=name,
                from_bus=ends[0].name,
                to_bus=ends[1].name,
                phases=phases,
                config=config,
                length=row.columns.length_m / 1000.0,
            )
    return tuple(lines.values())


def read_switches(buses: BusTable) -> tuple[Switch, ...]:
    """Read switches.csv; a switch is named by its buses ("13-152"), column alias may give a second name."""
    switches: list[Switch] = []
    names: set[str] = set()
    for row in buses.table("switches.csv", SwitchColumns):
        phases, alias, closed = row.columns.phases, row.columns.alias, row.columns.state == "closed"
        ends = buses.find_ends(row, phases)
        if not ends:
            continue
        buses.require_equal_voltage(row, ends, "switch")
        one, other = ends[0].name, ends[1].name
        name = f"{one}-{other}"
        for text in (name, alias):
            row.is_new("switch", text, names)
        switch = Switch(name=name, alias=alias, from_bus=one, to_bus=other, phases=phases, closed=closed)
        names.update(switch.names)
        switches.append(switch)
    return tuple(switches)


def read_regulators(buses: BusTable) -> tuple[Regulator, ...]:
    """Read regulators.csv; one row for all phases that stand on the same tap."""
    regulators: list[Regulator] = []
    seen: set[tuple[str, str]] = set()
    for row in buses.table("regulators.csv", RegulatorColumns):
        name, phases = row.columns.regulator, row.columns.phases
        ends = buses.find_ends(row, phases)
        ratio = 1.0 + row.columns.tap * row.columns.tap_step_pu
        if ratio <= 0.0:
            row.problem(f"tap and tap_step_pu give a ratio of {ratio:g}; it must be positive")
        elif not math.isnan(ratio) and not RATIO.low <= ratio <= RATIO.high:
            row.problem(
                f"tap and tap_step_pu give a ratio of {ratio:g}; {RATIO.low:g} to {RATIO.high:g} makes sense "
                "(tap is a number of steps, as in 5 or -3, each of 0.00625 pu as a rule)"
            )
        for phase in [phase for phase in phases if (name, phase) in seen]:
            row.problem(f'regulator "{name}" phase {phase}: given already; give each phase once')
        seen |= {(name, phase) for phase in phases}
        if ends:
            buses.require_equal_voltage(row, ends, "regulator")
            regulators.append(
                Regulator(name=name, from_bus=ends[0].name, to_bus=ends[1].name, phases=phases, ratio=ratio)
            )
    return tuple(regulators)


def read_transformers(buses: BusTable) -> tuple[Transformer, ...]:
    transformers: dict[str, Transformer] = {}
    for row in buses.table("transformers.csv", TransformerColumns):
        it, name = row.columns, row.columns.transformer
        ends = buses.find_ends(row, "ABC")
        if ends:
            most = power_of("a transformer", min(end.V_nom for end in ends), RATED_CURRENT, 3)
            row.require("S_rated_kVA", replace(most, low=1.0))
        if row.is_new("transformer", name, transformers) and ends:
            transformers[name] = Transformer(
                name=name,
                from_bus=ends[0].name,
                to_bus=ends[1].name,
                connection=it.connection,
                S_rated=it.S_rated_kVA * 1000.0,
                z=complex(it.R_percent, it.X_percent) / 100.0,
            )
    return tuple(transformers.values())


def _positive_definite(matrix: tuple[tuple[float, ...], ...]) -> bool:
    """Return whether a symmetric matrix of up to three rows is positive definite, by its leading minors."""
    (a, *ab), rest = matrix[0], matrix[1:]
    if a <= 0.0:
        return False
    schur = tuple(tuple(x - row[0] * ab[k] / a for k, x in enumerate(row[1:])) for row in rest)
    return not schur or _positive_definite(schur)
