"""Tables of what stands at one bus: loads, capacitors, inverters, the source."""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from math import radians
from typing import Any

from gridpeers.plant.equipment import Bus, Capacitor, Feeder, InverterRow, Load, Source
from gridpeers.plant.equipment.connectivity import buses_without_ground
from gridpeers.plant.equipment.inverter_parameters import OwnParameters, foreign, with_published
from gridpeers.plant.equipment.neutrals import neutral_for, neutrals_of
from gridpeers.plant.tables.buses import BusTable, require_ground, require_phases
from gridpeers.plant.tables.csv_table import CsvRow
from gridpeers.plant.tables.feeder_columns import (
    BRANCH_CURRENT,
    RATED_CURRENT,
    TIMES_THE_LOAD,
    CapacitorColumns,
    InverterColumns,
    LoadColumns,
    SourceColumns,
    power_of,
)
from gridpeers.wire.bounds import MOST_INVERTERS
from gridpeers.wire.keys import check_name
from gridpeers.wire.messages import OFF, PLANT
from gridpeers.wire.schema.plausible import Plausible
from gridpeers.wire.wording import suggestion

TAKEN = {
    PLANT: "the plant sends under it",
    "grid": "it is the island that the substation feeds",
    OFF: "it stands in place of an island for an inverter that is out of service",
}
"""Names that no inverter can have, and why."""

_POWERS = ("P_a_kW", "Q_a_kvar", "P_b_kW", "Q_b_kvar", "P_c_kW", "Q_c_kvar")


def read_loads(buses: BusTable, file: str, *, required: bool = True) -> tuple[Load, ...]:
    """Read a load set: powers at nominal voltage, per phase (Y) or per pair of phases (D)."""
    loads: list[Load] = []
    for row in buses.table(file, LoadColumns, required=required):
        it, bus = row.columns, buses.find(row)
        if bus is None:
            continue
        for column in _POWERS:
            row.require(column, power_of("a load", bus.V_nom, BRANCH_CURRENT, 1))
        powers = (it.P_a_kW, it.Q_a_kvar), (it.P_b_kW, it.Q_b_kvar), (it.P_c_kW, it.Q_c_kvar)
        S = tuple(1000.0 * complex(P, Q) for P, Q in powers)
        if it.connection == "Y":
            buses.require_ground(row, bus, "a Y load")
        across = ("A", "B", "C") if it.connection == "Y" else ("AB", "BC", "CA")
        for branch, power in zip(across, S, strict=True):
            missing = [phase for phase in branch if phase not in bus.phases]
            if power == 0 or not missing:
                continue
            between = f"between {branch[0]} and {branch[1]}" if it.connection == "D" else f"on phase {branch}"
            row.problem(f'bus "{bus.name}" has a load {between} but no phase {", ".join(missing)}; it has {bus.phases}')
        loads.append(Load(bus=bus.name, connection=it.connection, model=it.model, S=(S[0], S[1], S[2])))
    return tuple(loads)


def read_capacitors(buses: BusTable) -> tuple[Capacitor, ...]:
    capacitors: list[Capacitor] = []
    for row in buses.table("capacitors.csv", CapacitorColumns):
        it, bus = row.columns, buses.find(row)
        Q = tuple(1000.0 * kvar for kvar in (it.Q_a_kvar, it.Q_b_kvar, it.Q_c_kvar))
        V_rated = it.V_rated_kV_LN * 1000.0
        if bus is not None:
            for column in ("Q_a_kvar", "Q_b_kvar", "Q_c_kvar"):
                row.require(column, power_of("a capacitor bank", bus.V_nom, BRANCH_CURRENT, 1))
            require_phases(row, bus, [phase for phase, q in zip("ABC", Q, strict=True) if q])
            if buses.require_ground(row, bus, "a capacitor bank"):
                _require_bank_voltage(row, V_rated, bus)
            capacitors.append(Capacitor(bus=bus.name, Q=(Q[0], Q[1], Q[2]), V_rated=V_rated))
    return tuple(capacitors)


def _require_bank_voltage(row: CsvRow[Any], V_rated: float, bus: Bus) -> None:
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
    buses: BusTable, load: float, neutrals: Mapping[str, str], sets: Mapping[str, OwnParameters] | None
) -> tuple[InverterRow, ...]:
    """Read inverters.csv: nameplates, places, and the sets of parameters by name, None where they are unreadable.

    An inverter returns to the neutral of its bus, of `neutrals`, where it says nothing else.

    A rating is held against the feeder's load (W): one that is more than `TIMES_THE_LOAD` of it is in another unit.
    """
    inverters: dict[str, InverterRow] = {}
    at: dict[tuple[str, str], str] = {}
    for row in buses.table("inverters.csv", InverterColumns):
        it, name, bus = row.columns, row.columns.name, buses.find(row)
        if it.parameters and sets is not None:
            _require_set(row, sets)
        row.is_new("inverter", name, inverters)
        neutral = _check_place(row, bus, load, at, buses.floating, it.neutral, neutrals)
        if bus is None:
            continue
        for phase in "" if "phases" in row.wrong else it.phases:
            at.setdefault((bus.name, phase), name)
        inverters.setdefault(
            name,
            InverterRow(
                name=name,
                kind=it.kind,
                bus=bus.name,
                microgrid=it.microgrid,
                P_rated=it.P_rated_kW * 1000.0,
                V_nom=bus.V_nom,
                m_p=it.m_p_pu,
                m_q=it.m_q_pu,
                phases=it.phases,
                neutral=neutral,
                spare=it.spare == "yes",
                parameters=it.parameters,
            ),
        )
    if len(inverters) > MOST_INVERTERS:
        buses.problems.append(f"inverters.csv: has {len(inverters)} inverters; a run has at most {MOST_INVERTERS}")
    return tuple(inverters.values())


def problems_of(inverter: InverterRow, bus: Bus, feeder: Feeder) -> list[str]:
    """Return what the tables would refuse of a further inverter of a feeder, at a bus of it."""
    problems: list[str] = []
    numbers = {"P_rated_kW": (inverter.P_rated, 1e3), "m_p_pu": (inverter.m_p, 1.0), "m_q_pu": (inverter.m_q, 1.0)}
    cells: dict[str, str] = {
        key: "" if (text := getattr(inverter, key)) is None else str(text)
        for key in ("name", "kind", "bus", "microgrid", "phases")
    }
    cells.update({key: _cell(value, unit) for key, (value, unit) in numbers.items()})
    row = CsvRow(InverterColumns, f'inverter "{inverter.name}"', cells, problems)
    others = (*feeder.inverters, *feeder.spares)
    at = {(other.bus, phase): other.name for other in others for phase in other.phases}
    floating = buses_without_ground(feeder.transformers, feeder.lines, [*feeder.switches, *feeder.regulators])
    load = sum(feeder.load_by_bus().values())
    if any(inverter.name == other.name for other in others):
        row.problem("there is one of this name already; names must differ")
    _check_place(row, bus, load, at, floating, inverter.neutral, neutrals_of(feeder))
    return problems


def _check_place(
    row: CsvRow[InverterColumns],
    bus: Bus | None,
    load: float,
    at: Mapping[tuple[str, str], str],
    floating: Container[str],
    neutral: str,
    neutrals: Mapping[str, str],
) -> str:
    """Note what is wrong with the name, the rating (beside the load, W) and the place of an inverter.

    `at`: the inverters that stand at each node; `floating`: buses without ground; `neutral`: the node to which it shall
    return; `neutrals`: those of the buses. Return the node to which it returns.
    """
    it = row.columns
    if bus is not None and not math.isnan(bus.V_nom):
        row.require("P_rated_kW", _rating(bus, it.phases, load / 1e3))
    if it.name:
        _require_name(row, it.name)
    if bus is None:
        return ""
    phases = "" if "phases" in row.wrong else it.phases
    require_phases(row, bus, phases)
    require_ground(row, bus, "an inverter", floating)
    if taken := next((phase for phase in phases if (bus.name, phase) in at), None):
        row.problem(
            f'bus "{bus.name}" has inverter "{at[bus.name, taken]}" on phase {taken} already; '
            "only one can stand on each phase of a bus"
        )
    try:
        return neutral_for(neutral, bus, phases, neutrals.get(bus.name, ""))
    except ValueError as error:
        row.problem(str(error))
        return ""


def _cell(value: Any, unit: float) -> str:
    """Return a number in a table's unit, as a cell of it; anything else as it is."""
    try:
        return repr(float(value) / unit)
    except (TypeError, ValueError, OverflowError):
        return str(value)


def _require_set(row: CsvRow[InverterColumns], sets: Mapping[str, OwnParameters]) -> None:
    """Note a problem if an inverter's set of parameters is not there, or has what its kind has not."""
    name, kind = row.columns.parameters, row.columns.kind
    known = with_published(sets)
    if name not in known:
        row.problem(f'parameters "{name}": no such set; {suggestion(name, known, "sets")}')
    elif wrong := foreign(known[name], kind):
        row.problem(f'parameters "{name}": a {kind} has no {", ".join(wrong)}; give it a set of its own')


def _rating(bus: Bus, phases: str, load: float) -> Plausible:
    """Return the range of the rating (kW) of an inverter on phases of a bus, in a feeder with so much load (kW)."""
    most = power_of("an inverter", bus.V_nom, RATED_CURRENT, len(phases))
    among = load > 0.0 and load * TIMES_THE_LOAD < most.high
    what = f"{most.what} beside {load:.4g} kW of load" if among else most.what
    return Plausible(what, 1.0, load * TIMES_THE_LOAD if among else most.high)


def _require_name(row: CsvRow[Any], name: str) -> None:
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


def read_source(buses: BusTable) -> Source | None:
    """Read source.csv: the substation, at most one."""
    found: Source | None = None
    for row in buses.table("source.csv", SourceColumns):
        bus = buses.find(row)
        if found is not None:
            row.problem("a second source; a feeder has one at most")
        if bus is not None:
            require_phases(row, bus, "ABC")
            found = found or Source(bus=bus.name, V_pu=row.columns.V_pu, angle=radians(row.columns.angle_deg))
    return found
