"""A feeder into a folder of tables, which `read_feeder` reads."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from math import degrees, sqrt
from pathlib import Path
from typing import Any

from gridpeers.plant.equipment import InverterRow, Line, LineConfig, Regulator, Tables, Transformer
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.equipment.neutrals import EARTH, neutrals_of
from gridpeers.plant.tables.feeder_columns import LOAD_SETS, TABLES, InverterColumns

TAP_STEP = 0.00625  # step (pu) in which the ratios of regulators are written

Row = Sequence[Any]  # cells in the order of a table's columns


def write_feeder(feeder: Tables, folder: Path) -> None:
    """Write a feeder's tables into a folder, which is created if needed; they replace the tables in it.

    Numbers are converted to the units of the tables, so what is read back may differ in the last digit.
    """
    of_load_set = {f"{kind}{feeder.load_set}.csv": columns for kind, columns in LOAD_SETS.items()}
    tables = dict(_tables(feeder))
    folder.mkdir(parents=True, exist_ok=True)
    for file, columns in (TABLES | of_load_set).items():
        if file not in tables:
            (folder / file).unlink(missing_ok=True)
            continue
        with (folder / file).open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(columns.__struct_fields__)
            writer.writerows(tables[file])
    (folder / "feeder.toml").write_text(f"f_nom_Hz = {feeder.f_nom!r}\n", encoding="utf-8")


def _tables(feeder: Tables) -> Iterator[tuple[str, list[Row]]]:
    kV = sqrt(3.0) / 1e3
    yield "buses.csv", [(it.name, it.phases, it.V_nom * kV, it.zone, it.x, it.y) for it in feeder.buses]
    if feeder.elements or not feeder.lines:
        yield "elements.csv", [(it.name, " ".join(map(".".join, it.nodes)), _matrix(it.Y)) for it in feeder.elements]
        yield f"load_parts_{feeder.load_set}.csv", [_load_part(it) for it in feeder.load_parts]
    if feeder.lines or feeder.loads:
        yield "lines.csv", [(*_between(it), it.phases, it.config, it.length * 1e3) for it in feeder.lines]
        yield "line_configs.csv", [row for it in feeder.line_configs for row in _upper_triangle(it)]
        powers = ((it, (part / 1e3 for S in it.S for part in (S.real, S.imag))) for it in feeder.loads)
        yield f"loads_{feeder.load_set}.csv", [(it.bus, it.connection, it.model, *parts) for it, parts in powers]
        optional: dict[str, list[Row]] = {
            "capacitors.csv": [(it.bus, *(Q / 1e3 for Q in it.Q), it.V_rated / 1e3) for it in feeder.capacitors],
            "regulators.csv": [
                (*_between(it), it.phases, (it.ratio - 1.0) / TAP_STEP, TAP_STEP) for it in feeder.regulators
            ],
            "transformers.csv": [
                (*_between(it), it.connection, it.S_rated / 1e3, it.z.real * 100.0, it.z.imag * 100.0)
                for it in feeder.transformers
            ],
        }
        yield from ((file, rows) for file, rows in optional.items() if rows)
    states = ((it, "closed" if it.closed else "open") for it in feeder.switches)
    yield "switches.csv", [(it.from_bus, it.to_bus, it.phases, state, it.alias) for it, state in states]
    neutrals, inverters = neutrals_of(feeder), (*feeder.inverters, *feeder.spares)
    earth = {it.name: it.neutral or (EARTH if it.bus in neutrals else "") for it in inverters}
    yield "inverters.csv", [tuple((inverter_cells(it) | {"neutral": earth[it.name]}).values()) for it in inverters]
    if source := feeder.source:
        yield "source.csv", [(source.bus, source.V_pu, degrees(source.angle))]


def _between(row: Line | Regulator | Transformer) -> Row:
    return row.name, row.from_bus, row.to_bus


def _load_part(it: LoadPart) -> Row:
    limits = it.V_low, it.V_min, it.V_max, it.edge, it.V_off, it.V_off_above
    return it.name, it.bus, *it.ends, it.S.real / 1e3, it.S.imag / 1e3, it.V_nom / 1e3, *it.exponents, *limits


def inverter_cells(it: InverterRow) -> dict[str, str]:
    """Return the cells of an inverter by their columns, for a file or to be checked."""
    texts = ("" if text is None else text for text in (it.name, it.kind, it.bus, it.microgrid))
    spare = "yes" if it.spare else ""
    values = (*texts, float(it.P_rated) / 1e3, it.m_p, it.m_q, it.phases, spare, it.parameters, it.neutral)
    return dict(zip(InverterColumns.__struct_fields__, map(str, values), strict=True))


def _upper_triangle(config: LineConfig) -> Iterator[Row]:
    for i, first in enumerate(config.phases):
        for k, second in enumerate(config.phases[i:], start=i):
            z = config.Z[i][k]
            yield config.name, first, second, z.real, z.imag, config.B[i][k] * 1e6


def _matrix(Y: Sequence[Sequence[complex]]) -> str:
    """Return the numbers of a matrix as `complex` reads them, without brackets: 1.5-2.5j."""
    numbers = (value for row in Y for value in row)
    return " ".join(f"{y.real!r}{y.imag:+.17g}j" if y.imag else repr(y.real) for y in numbers)
