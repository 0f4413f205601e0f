"""Feeders made of another one: with changed data, or joined from copies. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

import msgspec
from msgspec.structs import replace

from gridpeers.plant.equipment import InverterRow, Switch, Tables
from gridpeers.plant.plant_config import FeederChanges, InverterChange
from gridpeers.wire.messages import MOST_INVERTERS


def changed(feeder: Tables, changes: FeederChanges) -> Tables:
    """Return the feeder with changes applied; without any it is the same object.

    At another nominal frequency the equipment stays and its reactances change: those of lines and transformers, the
    lines' susceptances, and the capacitors' reactive power go with the frequency. Loads are powers at nominal
    frequency, and inverters' filters per-unit values at nominal frequency; both stay as they are.
    """
    if changes == FeederChanges():
        return feeder
    feeder = _at_frequency(feeder, feeder.f_nom if changes.f_nom is None else changes.f_nom)
    if changes.load_factor != 1.0:
        k = changes.load_factor
        loads = tuple(replace(load, S=(k * load.S[0], k * load.S[1], k * load.S[2])) for load in feeder.loads)
        parts = tuple(replace(part, S=k * part.S) for part in feeder.load_parts)
        feeder = replace(feeder, loads=loads, load_parts=parts)
    return replace(
        feeder,
        inverters=tuple(_inverter(row, changes) for row in feeder.inverters),
        spares=tuple(_inverter(row, changes) for row in feeder.spares),
    )


def _inverter(row: InverterRow, changes: FeederChanges) -> InverterRow:
    change = changes.inverters.get(row.name, InverterChange())
    values = {"m_p": row.m_p * changes.m_p_factor, "m_q": row.m_q * changes.m_q_factor, "own": change.own}
    given = {name: getattr(change, name) for name in ("m_p", "m_q", "P_rated", "parameters")}
    return replace(row, **values | {name: value for name, value in given.items() if value is not None})


def _at_frequency(feeder: Tables, f_nom: float) -> Tables:
    if f_nom == feeder.f_nom:
        return feeder
    k = f_nom / feeder.f_nom
    return replace(
        feeder,
        f_nom=f_nom,
        line_configs=tuple(
            replace(
                config,
                Z=tuple(tuple(complex(z.real, k * z.imag) for z in row) for row in config.Z),
                B=tuple(tuple(k * b for b in row) for row in config.B),
            )
            for config in feeder.line_configs
        ),
        transformers=tuple(replace(it, z=complex(it.z.real, k * it.z.imag)) for it in feeder.transformers),
        capacitors=tuple(replace(it, Q=(k * it.Q[0], k * it.Q[1], k * it.Q[2])) for it in feeder.capacitors),
    )


TIE_LENGTH = 0.3  # length (km) of the line of a tie
AnyFeeder = TypeVar("AnyFeeder", bound=Tables)
Row = TypeVar("Row", bound=msgspec.Struct)

_REFERENCES = ("bus", "from_bus", "to_bus")  # fields of equipment that name a bus
_NAMES = ("name", "alias", "microgrid", "zone")  # fields whose names differ from copy to copy


def copy_name(name: str, k: int) -> str:
    """Return the name of a bus, a switch or an inverter in copy k; the first copy keeps its names."""
    return name if k == 1 or not name else f"{name}_{k}"


def joined_copies(feeder: AnyFeeder, copies: int, joint: str) -> AnyFeeder:
    """Return copies of a feeder at one substation, joined in a chain by ties between their buses `joint`.

    All copies hang on the first one's substation by closed switches. A tie is a closed switch and a line, so the copies
    remain one network when each is cut off the substation. Spare inverters are left out. ValueError if the feeder has
    no substation or was imported, the number is below 1 or makes too many inverters, or `joint` lacks a phase.
    """
    bus = next((each for each in feeder.buses if each.name == joint), None)
    if feeder.source is None or feeder.elements:
        raise ValueError(f'feeder "{feeder.name}": copies need a substation to share, and own tables of lines')
    most = MOST_INVERTERS // max(len(feeder.inverters), 1)
    if not 1 <= copies <= most:
        raise ValueError(
            f"copies: must be from 1 to {most}, as a run has at most {MOST_INVERTERS} inverters; got {copies}"
        )
    if bus is None or not set("ABC") <= set(bus.phases):
        raise ValueError(f'bus "{joint}": a tie needs a bus with phases A, B and C')
    fields = ("buses", "lines", "switches", "loads", "capacitors", "regulators", "transformers", "inverters")
    rows = {name: [row for k in range(1, copies + 1) for row in _copied(getattr(feeder, name), k)] for name in fields}
    source = feeder.source.bus
    width = max(each.x for each in feeder.buses) - min(each.x for each in feeder.buses)
    rows["buses"] = [
        replace(row, x=row.x + 1.1 * width * (i // len(feeder.buses))) for i, row in enumerate(rows["buses"])
    ]
    for k in range(2, copies + 1):
        rows["switches"].append(_tie_switch(source, copy_name(source, k), f"substation_{k}"))
        here, there, between = copy_name(joint, k - 1), copy_name(joint, k), f"tie_{k}"
        place = next(row for row in rows["buses"] if row.name == here)
        rows["buses"].append(replace(place, name=between, phases="ABC"))
        rows["switches"].append(_tie_switch(here, between, between))
        of_three = next(line for line in feeder.lines if line.phases == "ABC")
        ends = {"name": between, "from_bus": between, "to_bus": there}
        rows["lines"].append(replace(of_three, **ends, length=TIE_LENGTH))
    return replace(
        feeder,
        name=f"{feeder.name}_x{copies}",
        **{name: tuple(value) for name, value in rows.items()},
        spares=(),
    )


def _copied(rows: tuple[Row, ...], k: int) -> Iterator[Row]:
    """Yield the rows with the names of copy k."""
    for row in rows:
        fields = row.__struct_fields__
        changed = {name: copy_name(getattr(row, name), k) for name in (*_REFERENCES, *_NAMES) if name in fields}
        if isinstance(row, Switch):
            changed["name"] = f"{changed['from_bus']}-{changed['to_bus']}"
        yield replace(row, **changed)


def _tie_switch(one: str, other: str, alias: str) -> Switch:
    return Switch(name=f"{one}-{other}", alias=alias, from_bus=one, to_bus=other, phases="ABC", closed=True)
