"""A feeder from another program into a folder of tables, which `read_feeder` reads."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from math import degrees, sqrt
from pathlib import Path
from typing import Any

import msgspec

from plant.equipment import Feeder
from plant.own_parameters import OwnParameters
from plant.tables.feeder_columns import (
    BusColumns,
    ElementColumns,
    InverterColumns,
    LoadPartColumns,
    ParameterColumns,
    SourceColumns,
    SwitchColumns,
)
from plant.tables.parameter_sets import FILE
from wire.schema.table_schema import fields_of


def write_feeder(feeder: Feeder, folder: Path) -> None:
    """Write a feeder's tables into a folder, which is made if need be; what is there is written anew.

    Raises
    ------
    ValueError
        If the feeder has tables of our own (lines, transformers, loads): these are a folder already.
    OSError
        If the folder cannot be written.
    """
    if feeder.lines or feeder.transformers or feeder.regulators or feeder.capacitors or feeder.loads:
        raise ValueError(f'feeder "{feeder.name}" is made of tables of its own; copy its folder instead')
    folder.mkdir(parents=True, exist_ok=True)
    kV = sqrt(3.0) / 1e3
    buses = [(bus.name, bus.phases, bus.V_nom * kV, bus.zone, bus.x, bus.y) for bus in feeder.buses]
    _write(folder / "buses.csv", BusColumns, buses)
    _write(
        folder / "elements.csv",
        ElementColumns,
        (
            (
                element.name,
                " ".join(f"{bus}.{phase}" for bus, phase in element.nodes),
                " ".join(_number(value) for row in element.Y for value in row),
            )
            for element in feeder.elements
        ),
    )
    _write(
        folder / f"load_parts_{feeder.load_set}.csv",
        LoadPartColumns,
        (
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
            )
            for part in feeder.load_parts
        ),
    )
    _write(
        folder / "switches.csv",
        SwitchColumns,
        (
            (switch.from_bus, switch.to_bus, switch.phases, "closed" if switch.closed else "open", switch.alias)
            for switch in feeder.switches
        ),
    )
    _write(
        folder / "inverters.csv",
        InverterColumns,
        (
            (
                row.name,
                row.kind,
                row.bus,
                row.microgrid,
                row.P_rated / 1e3,
                row.m_p,
                row.m_q,
                "yes" if row.spare else "",
                row.parameters,
            )
            for row in (*feeder.inverters, *feeder.spares)
        ),
    )
    if feeder.parameter_sets:
        _write(
            folder / FILE,
            ParameterColumns,
            (
                (name, field.key, str(value).lower() if isinstance(value, bool) else value)
                for name, own in feeder.parameter_sets.items()
                for field in fields_of(OwnParameters)
                if (value := getattr(own, field.name)) is not None
            ),
        )
    if feeder.source:
        source = feeder.source
        _write(folder / "source.csv", SourceColumns, [(source.bus, source.V_pu, degrees(source.angle))])
    (folder / "feeder.toml").write_text(f"f_nom_Hz = {feeder.f_nom!r}\n", encoding="utf-8")


def _write(path: Path, columns: type[msgspec.Struct], rows: Iterable[Sequence[Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns.__struct_fields__)
        writer.writerows(rows)


def _number(value: complex) -> str:
    """Return a complex number as `complex` reads it, without brackets: 1.5-2.5j."""
    return f"{value.real!r}{value.imag:+.17g}j" if value.imag else repr(value.real)
