"""Tables of what lies between two buses: lines and their configurations, switches, regulators, transformers."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Literal, cast

from plant.equipment import PHASES, Line, LineConfig, Regulator, Switch, Transformer
from plant.tables.buses import BusTable
from plant.tables.csv_table import CsvRow, CsvTable
from plant.tables.plausible_feeder import (
    LENGTH,
    MUTUAL,
    R_PERCENT,
    RATED_CURRENT,
    RATIO,
    SELF_R,
    SELF_X,
    SHUNT,
    X_PERCENT,
    positive_definite,
    power_of,
)
from wire.suggestion import suggestion


def read_line_configs(folder: Path, problems: list[str]) -> dict[str, LineConfig] | None:
    """Read line_configs.csv: the upper triangles of the matrices, one element per row. None if it is unreadable."""
    columns = ("config", "phase_1", "phase_2", "R_ohm_per_km", "X_ohm_per_km", "B_uS_per_km")
    elements: dict[str, dict[tuple[str, str], tuple[complex, float]]] = {}
    last_row: dict[str, CsvRow] = {}
    mistaken: dict[str, bool] = {}
    spoiled: set[str] = set()  # an element stands nobody knows where, so none can be called missing
    table = CsvTable(folder, "line_configs.csv", columns, problems, required=True)
    for row in table:
        name = row.text("config")
        first, second = (row.choice(column, "phase", PHASES) for column in ("phase_1", "phase_2"))
        misplaced = row.mistaken
        diagonal = first == second and not misplaced
        above = 0.0 if diagonal else None
        R = row.number("R_ohm_per_km", above=above, plausible=SELF_R if diagonal else MUTUAL)
        X = row.number("X_ohm_per_km", above=above, plausible=SELF_X if diagonal else MUTUAL)
        B = row.number("B_uS_per_km", at_least=above, plausible=SHUNT) * 1e-6
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
            if not positive_definite(tuple(tuple(map(part, row)) for row in Z)):
                last_row[name].problem(
                    f'config "{name}" has {what} matrix that no line has (not positive definite); the elements off '
                    "the diagonal must be smaller than those on it"
                )
    return configs if table.readable else None


def read_lines(
    folder: Path, buses: BusTable, configs: dict[str, LineConfig] | None, problems: list[str]
) -> tuple[Line, ...]:
    """Read lines.csv; lengths in m."""
    columns = ("line", "from_bus", "to_bus", "phases", "config", "length_m")
    lines: dict[str, Line] = {}
    for row in CsvTable(folder, "lines.csv", columns, problems, required=True):
        name, config, phases = row.text("line"), row.text("config"), row.phases()
        length = row.number("length_m", above=0.0, plausible=LENGTH)
        ends = buses.find_ends(row, phases)
        if configs is None or not config:
            pass
        elif config not in configs:
            row.problem(
                f'config "{config}": no such line configuration; {suggestion(config, configs, "line configurations")}'
            )
        elif not set(phases) <= set(configs[config].phases):
            row.problem(f'config "{config}" is for phases {configs[config].phases}, the line carries {phases}')
        if name in lines:
            row.problem(f'line "{name}": there is one of this name already; names must differ')
        elif ends:
            buses.require_equal_voltage(row, ends, "line")
            lines[name] = Line(
                name=name,
                from_bus=ends[0].name,
                to_bus=ends[1].name,
                phases=phases,
                config=config,
                length=length / 1000.0,
            )
    return tuple(lines.values())


def read_switches(folder: Path, buses: BusTable, problems: list[str]) -> tuple[Switch, ...]:
    """Read switches.csv; a switch is named by its buses ("13-152"), column alias may give a second name."""
    columns = ("from_bus", "to_bus", "phases", "state")
    switches: list[Switch] = []
    names: set[str] = set()
    for row in CsvTable(folder, "switches.csv", columns, problems):
        phases = row.phases()
        ends = buses.find_ends(row, phases)
        closed = row.choice("state", "state of a switch", ("closed", "open")) == "closed"
        if not ends:
            continue
        buses.require_equal_voltage(row, ends, "switch")
        one, other = ends[0].name, ends[1].name
        name, alias = f"{one}-{other}", row.text("alias", default="")
        for taken in [text for text in (name, alias) if text in names]:
            row.problem(f'switch "{taken}": there is one of this name already; names must differ')
        switch = Switch(name=name, alias=alias, from_bus=one, to_bus=other, phases=phases, closed=closed)
        names.update(switch.names)
        switches.append(switch)
    return tuple(switches)


def read_regulators(folder: Path, buses: BusTable, problems: list[str]) -> tuple[Regulator, ...]:
    """Read regulators.csv; one row for all phases that stand on the same tap."""
    columns = ("regulator", "from_bus", "to_bus", "phases", "tap", "tap_step_pu")
    regulators: list[Regulator] = []
    seen: set[tuple[str, str]] = set()
    for row in CsvTable(folder, "regulators.csv", columns, problems):
        name, phases = row.text("regulator"), row.phases()
        ends = buses.find_ends(row, phases)
        ratio = 1.0 + row.number("tap") * row.number("tap_step_pu", above=0.0)
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


def read_transformers(folder: Path, buses: BusTable, problems: list[str]) -> tuple[Transformer, ...]:
    """Read transformers.csv; impedances in percent of the rating."""
    columns = ("transformer", "from_bus", "to_bus", "connection", "S_rated_kVA", "R_percent", "X_percent")
    transformers: dict[str, Transformer] = {}
    for row in CsvTable(folder, "transformers.csv", columns, problems):
        name = row.text("transformer")
        ends = buses.find_ends(row, "ABC")
        connection = row.choice("connection", "connection of a transformer", ("D-D", "Yg-Yg"))
        most = power_of("a transformer", min(end.V_nom for end in ends), RATED_CURRENT, 3) if ends else None
        S_rated = row.number("S_rated_kVA", above=0.0, plausible=most and replace(most, low=1.0)) * 1000.0
        R = row.number("R_percent", at_least=0.0, plausible=R_PERCENT)
        z = complex(R, row.number("X_percent", above=0.0, plausible=X_PERCENT)) / 100.0
        if name in transformers:
            row.problem(f'transformer "{name}": there is one of this name already; names must differ')
        elif ends:
            if connection == "D-D":
                buses.mark_floating(ends[1])
            transformers[name] = Transformer(
                name=name,
                from_bus=ends[0].name,
                to_bus=ends[1].name,
                connection=cast(Literal["D-D", "Yg-Yg"], connection),
                S_rated=S_rated,
                z=z,
            )
    return tuple(transformers.values())
