"""Generators, photovoltaic systems and storage of an OpenDSS circuit, as the constant power that each delivers."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plant.equipment.imported_equipment import LoadPart
from plant.imports.opendss.dss_elements import complex_of, letter_of
from plant.imports.opendss.dss_engine import DssEngine

GENERATION = frozenset({"generator", "pvsystem", "storage"})
"""Classes that are taken over as the power that they deliver in the script's snapshot."""

IMPEDANCE = 2
"""Model whose power goes with the square of the voltage; that of the other models is constant within limits."""

CLOSE = 1e-6
"""Largest difference between the engine's current and that of the parts, beside the largest current."""


class Branches(NamedTuple):
    """The phases of a generator between its nodes."""

    ends: list[tuple[int, int]]
    """Conductors of each phase."""
    V: NDArray[np.complex128]
    """Voltage across each (V)."""
    V_nom: float
    """Nominal voltage across each (V)."""


def read_generation(engine: DssEngine, name: str, notes: list[str], problems: list[str]) -> list[LoadPart]:
    """Return the parts of an element of `GENERATION`: loads of negative power, the same in each phase.

    The power is that of the engine's solution. Outside `vminpu` and `vmaxpu` the element is an impedance, as there.
    Problems take an element that the engine lets deliver another current (a limit of its current, unequal phases).
    """
    engine.circuit.SetActiveElement(name)
    element = engine.circuit.ActiveCktElement
    V, current = complex_of(element.Voltages), complex_of(element.Currents)
    total = complex(-np.sum(V * np.conj(current)))
    if abs(total) < 1.0:
        notes.append(f"{name}: delivers nothing; left out")
        return []
    branches = _branches(element, V)
    model = int(_property(element, "model") or 1)
    V_min, V_max = (float(_property(element, key)) for key in ("vminpu", "vmaxpu"))
    m = np.abs(branches.V) / branches.V_nom
    inside = (m > V_min) & (m <= V_max)
    factor = m**2 if model == IMPEDANCE else np.where(inside, 1.0, (m / np.where(m <= V_min, V_min, V_max)) ** 2)
    S = total / factor.sum()
    of_parts = np.zeros(current.size, complex)
    for (start, end), delivered in zip(branches.ends, np.conj(S * factor / branches.V), strict=True):
        of_parts[start] -= delivered
        of_parts[end] += delivered
    if np.abs(of_parts - current).max() > CLOSE * np.abs(current).max():
        problems.append(
            f"{name}: delivers no constant power, or not the same in each phase (a limit of its current, another "
            f'control); leave it out (leave_out=["{name}"]) or put an inverter there'
        )
        return []
    kind = "as an impedance" if model == IMPEDANCE else "constant"
    kW, kvar = (round(power / 1e3, 3) + 0.0 for power in (total.real, total.imag))
    notes.append(f"{name}: delivers the {kW:g} kW and {kvar:g} kvar of the snapshot, {kind}")
    return _parts(name, element, branches, S, model, (V_min, V_max))


def _parts(
    name: str, element: Any, branches: Branches, S: complex, model: int, limits: tuple[float, float]
) -> list[LoadPart]:
    letters = [letter_of(node) for node in element.NodeOrder]
    constant = model != IMPEDANCE
    parts = []
    for start, end in branches.ends:
        pair = letters[start], letters[end]
        if pair[0] == pair[1]:
            continue  # both ends at one node, or at ground
        parts.append(
            LoadPart(
                name=name,
                bus=str(element.BusNames[0]).partition(".")[0].lower(),
                ends=pair if pair[0] else (pair[1], pair[0]),
                S=-S,
                V_nom=branches.V_nom,
                exponents=(0.0, 0.0) if constant else (2.0, 2.0),
                V_min=limits[0] if constant else 0.0,
                V_max=limits[1] if constant else 0.0,
            )
        )
    return parts


def _branches(element: Any, V: NDArray[np.complex128]) -> Branches:
    phases, conductors = int(element.NumPhases), int(element.NumConductors)
    kV = float(_property(element, "kv"))
    if _property(element, "conn").lower().startswith(("d", "l")):
        ends, V_nom = [(k, (k + 1) % conductors) for k in range(phases)], kV * 1e3
    else:
        ends, V_nom = [(k, phases) for k in range(phases)], kV * 1e3 / (sqrt(3.0) if phases in (2, 3) else 1.0)
    return Branches(ends, np.array([V[start] - V[end] for start, end in ends]), V_nom)


def _property(element: Any, key: str) -> str:
    return str(element.Properties(key).Val)
