"""Tables of what stands at one bus: loads, capacitors, inverters, the source."""

from __future__ import annotations

import math
import re
from math import radians
from pathlib import Path
from typing import Literal, cast

from plant.equipment import Bus, Capacitor, InverterRow, Load, Source
from plant.tables.buses import BusTable
from plant.tables.csv_table import CsvRow, CsvTable
from plant.tables.plausible_feeder import (
    BRANCH_CURRENT,
    P_F_DROOP,
    Q_V_DROOP,
    RATED_CURRENT,
    SOURCE_ANGLE,
    SOURCE_VOLTAGE,
    TIMES_THE_LOAD,
    power_of,
)
from wire.keys import check_name
from wire.messages import OFF, PLANT
from wire.plausible import Plausible

TAKEN = {
    PLANT: "the plant sends under it",
    "grid": "it is the island that the substation feeds",
    OFF: "it stands in place of an island for an inverter that is out of service",
}
"""Names that no inverter can have, and why."""

LOAD_COLUMNS = ("bus", "connection", "model", "P_a_kW", "Q_a_kvar", "P_b_kW", "Q_b_kvar", "P_c_kW", "Q_c_kvar")
"""Columns of a load set; for a delta load a, b, c are A-B, B-C, C-A."""


def read_loads(folder: Path, file: str, buses: BusTable, problems: list[str]) -> tuple[Load, ...]:
    """Read a load set: powers at nominal voltage, per phase (Y) or per pair of phases (D)."""
    loads: list[Load] = []
    for row in CsvTable(folder, file, LOAD_COLUMNS, problems, required=True):
        bus = buses.find(row)
        connection = row.choice("connection", "connection of a load", ("Y", "D"))
        model = row.choice("model", "load model", ("P", "I", "Z"))
        most = power_of("a load", bus.V_nom, BRANCH_CURRENT, 1) if bus else None
        S = tuple(
            1000.0 * complex(row.number(f"P_{p}_kW", plausible=most), row.number(f"Q_{p}_kvar", plausible=most))
            for p in "abc"
        )
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
            row.problem(f'bus "{bus.name}" has a load {between} but no phase {", ".join(missing)}; it has {bus.phases}')
        loads.append(
            Load(
                bus=bus.name,
                connection=cast(Literal["Y", "D"], connection),
                model=cast(Literal["Z", "I", "P"], model),
                S=(S[0], S[1], S[2]),
            )
        )
    return tuple(loads)


def read_capacitors(folder: Path, buses: BusTable, problems: list[str]) -> tuple[Capacitor, ...]:
    """Read capacitors.csv: banks from phase to ground."""
    columns = ("bus", "Q_a_kvar", "Q_b_kvar", "Q_c_kvar", "V_rated_kV_LN")
    capacitors: list[Capacitor] = []
    for row in CsvTable(folder, "capacitors.csv", columns, problems):
        bus = buses.find(row)
        most = power_of("a capacitor bank", bus.V_nom, BRANCH_CURRENT, 1) if bus else None
        Q = tuple(1000.0 * row.number(f"Q_{p}_kvar", at_least=0.0, plausible=most) for p in "abc")
        V_rated = row.number("V_rated_kV_LN", above=0.0) * 1000.0
        if bus is not None:
            buses.require_phases(row, bus, [phase for phase, q in zip("ABC", Q, strict=True) if q])
            if buses.require_ground(row, bus, "a capacitor bank"):
                _require_bank_voltage(row, V_rated, bus)
            capacitors.append(Capacitor(bus=bus.name, Q=(Q[0], Q[1], Q[2]), V_rated=V_rated))
    return tuple(capacitors)


def _require_bank_voltage(row: CsvRow, V_rated: float, bus: Bus) -> None:
    """Note a problem if a bank's rated voltage (V) is not near its bus's nominal one, as 4.16 kV L-L is not at 2.40."""
    ratio = V_rated / bus.V_nom
    if math.isnan(ratio) or 0.9 <= ratio <= 1.5:
        return
    nominal, given = bus.V_nom / 1e3, V_rated / 1e3
    meant = f"; did you mean {given / 3**0.5:g} ({given:g} kV line-to-line)?" if 0.9 <= ratio / 3**0.5 <= 1.5 else ""
    meant = f"; did you mean {given / 1e3:g} ({given:g} V)?" if 0.9 <= ratio / 1e3 <= 1.5 else meant
    row.problem(
        f"V_rated_kV_LN: {given:g} kV is not plausible for a capacitor bank at a bus of {nominal:.4g} kV "
        f"line-to-neutral (0.9 to 1.5 times that){meant}"
    )


def read_inverters(
    folder: Path, buses: BusTable, loads: tuple[Load, ...], problems: list[str]
) -> tuple[InverterRow, ...]:
    """Read inverters.csv: nameplates and places. The column `spare` ("yes" or empty) may be missing.

    A rating is held against the feeder's loads: one that is more than `TIMES_THE_LOAD` of all is in another unit.
    """
    total = sum(S.real for load in loads for S in load.S if S.real > 0.0) / 1e3
    columns = ("name", "kind", "bus", "microgrid", "P_rated_kW", "m_p_pu", "m_q_pu")
    inverters: dict[str, InverterRow] = {}
    at: dict[str, str] = {}
    for row in CsvTable(folder, "inverters.csv", columns, problems):
        name, microgrid = row.text("name"), row.text("microgrid")
        kind = row.choice("kind", "kind of inverter", ("GFM", "GFL"))
        bus = buses.find(row)
        P_rated = row.number("P_rated_kW", above=0.0, plausible=_rating(bus, total)) * 1000.0
        m_p = row.number("m_p_pu", above=0.0, plausible=P_F_DROOP)
        m_q = row.number("m_q_pu", above=0.0, plausible=Q_V_DROOP)
        if name:
            _require_name(row, name)
        spare = row.text("spare", default="")
        if spare not in ("", "yes"):
            row.problem(f'spare "{spare}": must be "yes" or empty')
        if name in inverters:
            row.problem(f'inverter "{name}": there is one of this name already; names must differ')
        if bus is None:
            continue
        buses.require_phases(row, bus, "ABC")
        buses.require_ground(row, bus, "an inverter")
        if bus.name in at:
            row.problem(f'bus "{bus.name}" has inverter "{at[bus.name]}" already; only one can stand on a bus')
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


def _rating(bus: Bus | None, load: float) -> Plausible | None:
    """Range of the rating (kW) of an inverter at a bus of a feeder with so much load (kW)."""
    if bus is None or math.isnan(bus.V_nom):
        return None
    most = power_of("an inverter", bus.V_nom, RATED_CURRENT, 3)
    among = load > 0.0 and load * TIMES_THE_LOAD < most.high
    what = f"{most.what} beside {load:.4g} kW of load" if among else most.what
    return Plausible(what, 1.0, load * TIMES_THE_LOAD if among else most.high)


def _require_name(row: CsvRow, name: str) -> None:
    """Note a problem if an inverter's name cannot be a part of a key, or already means something else there."""
    try:
        check_name("name", name)
    except ValueError:
        if name.isprintable():
            row.problem(
                f'name "{name}" cannot be part of a Zenoh key; use 1 to 64 letters, digits, "_", "-" or ".", '
                f'as in "{re.sub(r"[^A-Za-z0-9_.-]", "", name)[:64] or "inv1"}"'
            )
    if name in TAKEN:
        row.problem(f'name "{name}" is taken: {TAKEN[name]}; name the inverter otherwise')


def read_source(folder: Path, buses: BusTable, problems: list[str]) -> Source | None:
    """Read source.csv: the substation, at most one."""
    found: Source | None = None
    for row in CsvTable(folder, "source.csv", ("bus", "V_pu", "angle_deg"), problems):
        bus = buses.find(row)
        V_pu = row.number("V_pu", above=0.0, plausible=SOURCE_VOLTAGE)
        angle = radians(row.number("angle_deg", plausible=SOURCE_ANGLE))
        if found is not None:
            row.problem("a second source; a feeder has one at most")
        if bus is not None:
            buses.require_phases(row, bus, "ABC")
            found = found or Source(bus=bus.name, V_pu=V_pu, angle=angle)
    return found
