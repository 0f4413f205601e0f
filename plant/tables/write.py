"""A feeder into a folder of tables, which `read_feeder` reads."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from math import degrees, sqrt
from pathlib import Path
from typing import Any

import msgspec

from gridpeers.plant.equipment import Feeder, LineConfig
from gridpeers.plant.equipment.inverter_parameters import OwnParameters
from gridpeers.plant.equipment.neutrals import EARTH, neutrals_of
from gridpeers.plant.tables import feeder_columns as columns
from gridpeers.plant.tables.parameter_sets import FILE
from gridpeers.wire.schema.table_schema import fields_of

TAP_STEP = 0.00625  # step (pu) in which the ratios of regulators are written

Row = Sequence[Any]
Table = tuple[str, type[msgspec.Struct], list[Row]]


def write_feeder(feeder: Feeder, folder: Path) -> None:
    """Write a feeder's tables into a folder, which is made if need be; they replace those of a feeder that is there.

    Numbers are converted to the units of the tables, so what is read back may differ in the last digit.
    """
    tables = list(_tables(feeder))
    folder.mkdir(parents=True, exist_ok=True)
    replaced = {*columns.TABLES, *(f"{kind}{feeder.load_set}.csv" for kind in columns.LOAD_SETS)}
    for file in replaced - {file for file, *_ in tables}:
        (folder / file).unlink(missing_ok=True)
    for file, of_row, rows in tables:
        with (folder / file).open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(of_row.__struct_fields__)
            writer.writerows(rows)
    (folder / "feeder.toml").write_text(f"f_nom_Hz = {feeder.f_nom!r}\n", encoding="utf-8")


def _tables(feeder: Feeder) -> Iterator[Table]:
    kV = sqrt(3.0) / 1e3
    neutrals = neutrals_of(feeder)
    yield (
        "buses.csv",
        columns.BusColumns,
        [(bus.name, bus.phases, bus.V_nom * kV, bus.zone, bus.x, bus.y) for bus in feeder.buses],
    )
    if feeder.elements or not feeder.lines:
        yield from _imported(feeder)
    if feeder.lines or feeder.loads:
        yield from _own(feeder)
    yield (
        "switches.csv",
        columns.SwitchColumns,
        [
            (switch.from_bus, switch.to_bus, switch.phases, "closed" if switch.closed else "open", switch.alias)
            for switch in feeder.switches
        ],
    )
    yield (
        "inverters.csv",
        columns.InverterColumns,
        [
            (
                row.name,
                row.kind,
                row.bus,
                row.microgrid,
                row.P_rated / 1e3,
                row.m_p,
                row.m_q,
                row.phases,
                "yes" if row.spare else "",
                row.parameters,
                row.neutral or (EARTH if row.bus in neutrals else ""),
            )
            for row in (*feeder.inverters, *feeder.spares)
        ],
    )
    if feeder.parameter_sets:
        yield (
            FILE,
            columns.ParameterColumns,
            [
                (name, field.key, str(value).lower() if isinstance(value, bool) else value)
                for name, own in feeder.parameter_sets.items()
                for field in fields_of(OwnParameters)
                if (value := getattr(own, field.name)) is not None
            ],
        )
    if feeder.source:
        source = feeder.source
        yield "source.csv", columns.SourceColumns, [(source.bus, source.V_pu, degrees(source.angle))]


def _imported(feeder: Feeder) -> Iterator[Table]:
    yield (
        "elements.csv",
        columns.ElementColumns,
        [
            (
                element.name,
                " ".join(f"{bus}.{phase}" for bus, phase in element.nodes),
                " ".join(_number(value) for row in element.Y for value in row),
            )
            for element in feeder.elements
        ],
    )
    yield (
        f"load_parts_{feeder.load_set}.csv",
        columns.LoadPartColumns,
        [
            (
                part.name,
                part.bus,
                *part.ends,
                part.S.real / 1e3,
                part.S.imag / 1e3,
                part.V_nom / 1e3,
                *part.exponents,
                part.V_low,
                part.V_min,
                part.V_max,
                part.edge,
                part.V_off,
                part.V_off_above,
            )
            for part in feeder.load_parts
        ],
    )


def _own(feeder: Feeder) -> Iterator[Table]:
    yield (
        "lines.csv",
        columns.LineColumns,
        [(line.name, line.from_bus, line.to_bus, line.phases, line.config, line.length * 1e3) for line in feeder.lines],
    )
    yield (
        "line_configs.csv",
        columns.LineConfigColumns,
        [row for config in feeder.line_configs for row in _upper_triangle(config)],
    )
    yield (
        f"loads_{feeder.load_set}.csv",
        columns.LoadColumns,
        [
            (load.bus, load.connection, load.model, *(part / 1e3 for S in load.S for part in (S.real, S.imag)))
            for load in feeder.loads
        ],
    )
    if feeder.capacitors:
        yield (
            "capacitors.csv",
            columns.CapacitorColumns,
            [(bank.bus, *(Q / 1e3 for Q in bank.Q), bank.V_rated / 1e3) for bank in feeder.capacitors],
        )
    if feeder.regulators:
        yield (
            "regulators.csv",
            columns.RegulatorColumns,
            [
                (row.name, row.from_bus, row.to_bus, row.phases, (row.ratio - 1.0) / TAP_STEP, TAP_STEP)
                for row in feeder.regulators
            ],
        )
    if feeder.transformers:
        yield (
            "transformers.csv",
            columns.TransformerColumns,
            [
                (
                    row.name,
                    row.from_bus,
                    row.to_bus,
                    row.connection,
                    row.S_rated / 1e3,
                    row.z.real * 100.0,
                    row.z.imag * 100.0,
                )
                for row in feeder.transformers
            ],
        )


def _upper_triangle(config: LineConfig) -> Iterator[Row]:
    for i, first in enumerate(config.phases):
        for k, second in enumerate(config.phases[i:], start=i):
            z = config.Z[i][k]
            yield config.name, first, second, z.real, z.imag, config.B[i][k] * 1e6


def _number(value: complex) -> str:
    """Return a complex number as `complex` reads it, without brackets: 1.5-2.5j."""
    return f"{value.real!r}{value.imag:+.17g}j" if value.imag else repr(value.real)
