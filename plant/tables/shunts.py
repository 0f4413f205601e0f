"""Tables of the equipment at one bus: loads and their parts, capacitors, inverters, the source."""

from __future__ import annotations

from collections.abc import Container, Mapping
from math import radians
from typing import NamedTuple

from gridpeers.plant.equipment import Bus, Capacitor, InverterRow, Load, Source, Tables
from gridpeers.plant.equipment.connectivity import buses_without_ground
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.equipment.neutrals import neutral_for, neutrals_of
from gridpeers.plant.inverters.inverter_registry import PUBLISHED_SETS, foreign
from gridpeers.plant.tables import feeder_columns as columns
from gridpeers.plant.tables.branches import BusTable, require_ground, require_phases
from gridpeers.plant.tables.csv_table import CsvRow
from gridpeers.plant.tables.write import inverter_cells
from gridpeers.wire.keys import check_name
from gridpeers.wire.messages import MOST_INVERTERS, OFF, PLANT
from gridpeers.wire.schema.table_schema import Plausible
from gridpeers.wire.wording import suggestion

TAKEN = {
    PLANT: "the plant sends under it",
    "grid": "it is the island that the substation feeds",
    OFF: "it is the island of an inverter that is out of service",
}
"""Names that no inverter can have, and why."""


def read_loads(buses: BusTable, file: str, *, required: bool = True) -> tuple[Load, ...]:
    loads: list[Load] = []
    for row in buses.table(file, columns.LoadColumns, required=required):
        it, bus = row.columns, buses.find(row)
        if bus is None:
            continue
        for column in ("P_a_kW", "Q_a_kvar", "P_b_kW", "Q_b_kvar", "P_c_kW", "Q_c_kvar"):
            row.require(column, columns.power_of("a load", bus.V_nom, columns.BRANCH_CURRENT, 1))
        powers = (it.P_a_kW, it.Q_a_kvar), (it.P_b_kW, it.Q_b_kvar), (it.P_c_kW, it.Q_c_kvar)
        S = tuple(1000.0 * complex(P, Q) for P, Q in powers)
        if it.connection == "Y":
            require_ground(row, bus, "a Y load", buses.floating)
        across = ("A", "B", "C") if it.connection == "Y" else ("AB", "BC", "CA")
        for branch, power in zip(across, S, strict=True):
            missing = [phase for phase in branch if phase not in bus.phases]
            if power == 0 or not missing:
                continue
            between = f"between {branch[0]} and {branch[1]}" if it.connection == "D" else f"on phase {branch}"
            row.problem(f'bus "{bus.name}" has a load {between} but no phase {", ".join(missing)}; it has {bus.phases}')
        loads.append(Load(bus=bus.name, connection=it.connection, model=it.model, S=(S[0], S[1], S[2])))
    return tuple(loads)


def read_load_parts(buses: BusTable, file: str) -> tuple[LoadPart, ...]:
    parts: list[LoadPart] = []
    for row in buses.table(file, columns.LoadPartColumns):
        it, bus = row.columns, buses.find(row)
        many = [key for key in ("from_phase", "to_phase") if len(getattr(it, key)) > 1]
        for key in many:
            row.problem(f'{key}: "{getattr(it, key)}" must be one phase (as "A"); give each phase a row of its own')
        if it.V_min_pu and not it.V_low_pu <= it.V_min_pu:
            row.problem(f"V_min_pu: {it.V_min_pu:g} pu must not be below V_low_pu, {it.V_low_pu:g} pu")
        if it.V_max_pu and not it.V_min_pu < it.V_max_pu:
            row.problem(f"V_max_pu: {it.V_max_pu:g} pu must be above V_min_pu, {it.V_min_pu:g} pu")
        for column in ("P_kW", "Q_kvar"):
            row.require(column, columns.power_of("a load", 1e3 * it.V_nom_kV, columns.PART_CURRENT, 1))
        if bus is None or many or not require_phases(row, bus, it.from_phase + it.to_phase):
            continue
        if it.from_phase == it.to_phase:
            row.problem(f"both ends are phase {it.from_phase}; a load is between two phases, or a phase and ground")
        parts.append(
            LoadPart(
                name=it.load,
                bus=bus.name,
                ends=(it.from_phase, it.to_phase),
                S=1e3 * complex(it.P_kW, it.Q_kvar),
                V_nom=1e3 * it.V_nom_kV,
                exponents=(it.n_P, it.n_Q),
                V_low=it.V_low_pu,
                V_min=it.V_min_pu,
                V_max=it.V_max_pu,
                edge=it.edge,
                V_off=it.V_off_pu,
                V_off_above=it.V_off_above_pu,
            )
        )
    return tuple(parts)


def read_capacitors(buses: BusTable) -> tuple[Capacitor, ...]:
    capacitors: list[Capacitor] = []
    for row in buses.table("capacitors.csv", columns.CapacitorColumns):
        it, bus = row.columns, buses.find(row)
        if bus is None:
            continue
        Q = 1000.0 * it.Q_a_kvar, 1000.0 * it.Q_b_kvar, 1000.0 * it.Q_c_kvar
        for column in ("Q_a_kvar", "Q_b_kvar", "Q_c_kvar"):
            row.require(column, columns.power_of("a capacitor bank", bus.V_nom, columns.BRANCH_CURRENT, 1))
        require_phases(row, bus, [phase for phase, q in zip("ABC", Q, strict=True) if q])
        require_ground(row, bus, "a capacitor bank", buses.floating)
        kV = bus.V_nom / 1000.0
        what, hint = f"a capacitor bank at a bus of {kV:.4g} kV", "; both are line-to-neutral"
        row.require("V_rated_kV_LN", Plausible(what, 0.9 * kV, 1.5 * kV, hint=hint))
        capacitors.append(Capacitor(bus=bus.name, Q=Q, V_rated=it.V_rated_kV_LN * 1000.0))
    return tuple(capacitors)


class InverterPlaces(NamedTuple):
    """What the place and rating of an inverter are checked against."""

    load: float  # the feeder's load (W): a rating of more than `TIMES_THE_LOAD` of it is in another unit
    taken: dict[tuple[str, str], str]  # the inverter at each node
    floating: Container[str]  # buses without ground
    neutrals: Mapping[str, str]  # neutrals of the buses


def read_inverters(buses: BusTable, load: float, neutrals: Mapping[str, str]) -> tuple[InverterRow, ...]:
    inverters: dict[str, InverterRow] = {}
    places = InverterPlaces(load, {}, buses.floating, neutrals)
    for row in buses.table("inverters.csv", columns.InverterColumns):
        it, name, bus = row.columns, row.columns.name, buses.find(row)
        row.is_new("inverter", name, inverters)
        neutral = _check_place(row, bus, it.neutral, places)
        if bus is None:
            continue
        for phase in "" if "phases" in row.wrong else it.phases:
            places.taken.setdefault((bus.name, phase), name)
        read = InverterRow(
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
        )
        inverters.setdefault(name, read)
    if len(inverters) > MOST_INVERTERS:
        buses.problems.append(f"inverters.csv: has {len(inverters)} inverters; a run has at most {MOST_INVERTERS}")
    return tuple(inverters.values())


def problems_of(inverter: InverterRow, bus: Bus, feeder: Tables) -> list[str]:
    """Return what is wrong with a further inverter at a bus of a feeder, as its tables would say."""
    problems: list[str] = []
    others = (*feeder.inverters, *feeder.spares)
    row = CsvRow(columns.InverterColumns, f'inverter "{inverter.name}"', inverter_cells(inverter), problems)
    if any(inverter.name == other.name for other in others):
        row.problem("exists already; names must differ")
    places = InverterPlaces(
        sum(feeder.load_by_bus().values()),
        {(other.bus, phase): other.name for other in others for phase in other.phases},
        buses_without_ground(feeder.transformers, feeder.lines, [*feeder.switches, *feeder.regulators]),
        neutrals_of(feeder),
    )
    _check_place(row, bus, inverter.neutral, places)
    return problems


def _check_place(row: CsvRow[columns.InverterColumns], bus: Bus | None, neutral: str, places: InverterPlaces) -> str:
    """Note what is wrong with an inverter's name, set, rating and place; return the node to which it returns.

    `neutral`: the node to which it shall return.
    """
    it = row.columns
    phases = "" if "phases" in row.wrong else it.phases
    if bus is not None:
        row.require("P_rated_kW", _rating(bus, it.phases, places.load / 1e3))
    if it.parameters and it.parameters not in PUBLISHED_SETS:
        hint = suggestion(it.parameters, PUBLISHED_SETS, "sets")
        row.problem(f'parameters "{it.parameters}": no such set; {hint}')
    elif it.parameters and (wrong := foreign(PUBLISHED_SETS[it.parameters], it.kind)):
        row.problem(f'parameters "{it.parameters}": a {it.kind} has no {", ".join(wrong)}')
    if it.name in TAKEN:
        row.problem(f'name "{it.name}" is taken: {TAKEN[it.name]}; choose another name')
    elif it.name and it.name.isprintable():
        try:
            check_name("name", it.name)
        except ValueError as error:
            row.problem(str(error))
    if bus is None:
        return ""
    require_phases(row, bus, phases)
    require_ground(row, bus, "an inverter", places.floating)
    if taken := next((phase for phase in phases if (bus.name, phase) in places.taken), None):
        row.problem(
            f'bus "{bus.name}" has inverter "{places.taken[bus.name, taken]}" on phase {taken} already; each '
            "phase of a bus takes only one"
        )
    try:
        return neutral_for(neutral, bus, phases, places.neutrals.get(bus.name, ""))
    except ValueError as error:
        row.problem(str(error))
        return ""


def _rating(bus: Bus, phases: str, load: float) -> Plausible:
    """Return the range of the rating (kW) of an inverter on phases of a bus, in a feeder with so much load (kW)."""
    most = columns.power_of("an inverter", bus.V_nom, columns.RATED_CURRENT, len(phases))
    high = load * columns.TIMES_THE_LOAD
    if 0.0 < high < most.high:
        return Plausible(f"{most.what} beside {load:.4g} kW of load", 1.0, high)
    return Plausible(most.what, 1.0, most.high)


def read_source(buses: BusTable) -> Source | None:
    found: Source | None = None
    for row in buses.table("source.csv", columns.SourceColumns):
        bus = buses.find(row)
        if found is not None:
            row.problem("a second source; a feeder has at most one")
        if bus is not None:
            require_phases(row, bus, "ABC")
            found = found or Source(bus=bus.name, V_pu=row.columns.V_pu, angle=radians(row.columns.angle_deg))
    return found
