"""Tables of a feeder that comes from another program: elements by their admittances, loads by parts."""

from __future__ import annotations

from cmath import isfinite
from typing import Any

from gridpeers.plant.equipment import Bus
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart
from gridpeers.plant.tables.buses import BusTable, require_phases
from gridpeers.plant.tables.csv_table import CsvRow
from gridpeers.plant.tables.feeder_columns import PART_CURRENT, ElementColumns, LoadPartColumns, power_of

Matrix = tuple[tuple[complex, ...], ...]


def read_elements(buses: BusTable) -> tuple[LinearElement, ...]:
    elements: dict[str, LinearElement] = {}
    for row in buses.table("elements.csv", ElementColumns):
        it = row.columns
        nodes = [_node(row, text, buses) for text in it.nodes.split()]
        Y = _matrix(row, it.Y_S, len(nodes))
        if row.is_new("element", it.element, elements) and Y is not None and all(nodes):
            elements[it.element] = LinearElement(name=it.element, nodes=tuple(filter(None, nodes)), Y=Y)
    return tuple(elements.values())


def read_load_parts(buses: BusTable, file: str) -> tuple[LoadPart, ...]:
    """Read load_parts_SET.csv: the parts of loads, between two phases of a bus, or a phase and ground."""
    parts: list[LoadPart] = []
    for row in buses.table(file, LoadPartColumns):
        it, bus = row.columns, buses.find(row)
        many = [key for key in ("from_phase", "to_phase") if len(getattr(it, key)) > 1]
        for key in many:
            row.problem(f'{key}: "{getattr(it, key)}" must be one phase (as "A"); give each phase a row of its own')
        if it.V_min_pu and not it.V_low_pu <= it.V_min_pu:
            row.problem(f"V_min_pu: {it.V_min_pu:g} pu must not be below V_low_pu, {it.V_low_pu:g} pu")
        if it.V_max_pu and not it.V_min_pu < it.V_max_pu:
            row.problem(f"V_max_pu: {it.V_max_pu:g} pu must be above V_min_pu, {it.V_min_pu:g} pu")
        for column in ("P_kW", "Q_kvar"):
            row.require(column, power_of("a load", 1e3 * it.V_nom_kV, PART_CURRENT, 1))
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


def _node(row: CsvRow[Any], text: str, buses: BusTable) -> tuple[str, str] | None:
    """Return the node that "650.A" names; None, and a problem noted, if there is none."""
    name, _, phase = text.rpartition(".")
    if not name or len(phase) != 1:
        row.problem(f'nodes: "{text}" is no node; write a bus and one of its phases, as "650.A"')
        return None
    bus: Bus | None = buses.named(row, "nodes", name)
    if bus is None or not require_phases(row, bus, phase):
        return None
    return bus.name, phase


def _matrix(row: CsvRow[Any], text: str, n: int) -> Matrix | None:
    """Return a square matrix of n rows; None, and a problem noted, if the text is none."""
    try:
        values = [complex(value) for value in text.split()]
    except ValueError as error:
        row.problem(f"Y_S: {error}; numbers are written as 1.5-2.5j")
        return None
    if len(values) != n * n or not all(map(isfinite, values)):
        row.problem(f"Y_S: has {len(values)} numbers; {n} nodes need {n} times {n}, all finite")
        return None
    return tuple(tuple(values[i * n : (i + 1) * n]) for i in range(n))
