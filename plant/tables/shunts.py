"""Tables of what stands at one bus: loads, capacitors, inverters, the source."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Literal, cast

from plant.equipment import Capacitor, InverterRow, Load, Source
from plant.tables.buses import BusTable
from plant.tables.table import Table

LOAD_COLUMNS = ("bus", "connection", "model", "P_a_kW", "Q_a_kvar", "P_b_kW", "Q_b_kvar", "P_c_kW", "Q_c_kvar")
"""Columns of a load set; for a delta load a, b, c are A-B, B-C, C-A."""


def read_loads(folder: Path, file: str, buses: BusTable, mistakes: list[str]) -> tuple[Load, ...]:
    """Read a load set: powers at nominal voltage, per phase (Y) or per pair of phases (D)."""
    loads: list[Load] = []
    for row in Table(folder, file, LOAD_COLUMNS, mistakes, required=True):
        bus = buses.find(row)
        connection = row.choice("connection", "connection of a load", ("Y", "D"))
        model = row.choice("model", "load model", ("P", "I", "Z"))
        S = tuple(1000.0 * complex(row.number(f"P_{p}_kW"), row.number(f"Q_{p}_kvar")) for p in "abc")
        if bus is None:
            continue
        if connection == "Y":
            buses.require_ground(row, bus, "a Y load")
        across = ("A", "B", "C") if connection == "Y" else ("AB", "BC", "CA")
        for branch, power in zip(across, S, strict=True):
            missing = [phase for phase in branch if phase not in bus.phases]
            if power == 0 or not missing:
                continue
            between = f"between {branch[0]} and {branch[1]}" if connection == "D" else f"on phase {branch}"
            row.mistake(f'bus "{bus.name}" has a load {between} but no phase {", ".join(missing)}; it has {bus.phases}')
        loads.append(
            Load(
                bus=bus.name,
                connection=cast(Literal["Y", "D"], connection),
                model=cast(Literal["Z", "I", "P"], model),
                S=(S[0], S[1], S[2]),
            )
        )
    return tuple(loads)


def read_capacitors(folder: Path, buses: BusTable, mistakes: list[str]) -> tuple[Capacitor, ...]:
    """Read capacitors.csv: banks from phase to ground."""
    columns = ("bus", "Q_a_kvar", "Q_b_kvar", "Q_c_kvar", "V_rated_kV_LN")
    capacitors: list[Capacitor] = []
    for row in Table(folder, "capacitors.csv", columns, mistakes):
        bus = buses.find(row)
        Q = tuple(1000.0 * row.number(f"Q_{p}_kvar", at_least=0.0) for p in "abc")
        V_rated = row.number("V_rated_kV_LN", above=0.0) * 1000.0
        if bus is not None:
            buses.require_phases(row, bus, [phase for phase, q in zip("ABC", Q, strict=True) if q])
            buses.require_ground(row, bus, "a capacitor bank")
            capacitors.append(Capacitor(bus=bus.name, Q=(Q[0], Q[1], Q[2]), V_rated=V_rated))
    return tuple(capacitors)


def read_inverters(folder: Path, buses: BusTable, mistakes: list[str]) -> tuple[InverterRow, ...]:
    """Read inverters.csv: nameplates and places. The column `spare` ("yes" or empty) may be missing."""
    columns = ("name", "kind", "bus", "microgrid", "P_rated_kW", "m_p_pu", "m_q_pu")
    inverters: dict[str, InverterRow] = {}
    at: dict[str, str] = {}
    for row in Table(folder, "inverters.csv", columns, mistakes):
        name, microgrid = row.text("name"), row.text("microgrid")
        kind = row.choice("kind", "kind of inverter", ("GFM", "GFL"))
        bus = buses.find(row)
        P_rated = row.number("P_rated_kW", above=0.0) * 1000.0
        m_p, m_q = row.number("m_p_pu", above=0.0), row.number("m_q_pu", above=0.0)
        spare = row.text("spare", default="")
        if spare not in ("", "yes"):
            row.mistake(f'spare "{spare}": must be "yes" or empty')
        if name in inverters:
            row.mistake(f'inverter "{name}": there is one of this name already; names must differ')
        if bus is None:
            continue
        buses.require_phases(row, bus, "ABC")
        buses.require_ground(row, bus, "an inverter")
        if bus.name in at:
            row.mistake(f'bus "{bus.name}" has inverter "{at[bus.name]}" already; only one can stand on a bus')
        at.setdefault(bus.name, name)
        inverters.setdefault(
            name,
            InverterRow(
                name=name,
                kind=cast(Literal["GFM", "GFL"], kind),
                bus=bus.name,
                microgrid=microgrid,
                P_rated=P_rated,
                V_nom=bus.V_nom,
                m_p=m_p,
                m_q=m_q,
                spare=spare == "yes",
            ),
        )
    return tuple(inverters.values())


def read_source(folder: Path, buses: BusTable, mistakes: list[str]) -> Source | None:
    """Read source.csv: the substation, at most one."""
    found: Source | None = None
    for row in Table(folder, "source.csv", ("bus", "V_pu", "angle_deg"), mistakes):
        bus = buses.find(row)
        V_pu, angle = row.number("V_pu", above=0.0), radians(row.number("angle_deg"))
        if found is not None:
            row.mistake("a second source; a feeder has one at most")
        if bus is not None:
            buses.require_phases(row, bus, "ABC")
            found = found or Source(bus=bus.name, V_pu=V_pu, angle=angle)
    return found
