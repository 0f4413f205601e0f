"""Generators, photovoltaic systems and storage of an OpenDSS circuit, as the constant power that each delivers."""

from __future__ import annotations

from typing import Any

import numpy as np

from plant.equipment.imported_equipment import LoadPart
from plant.imports.opendss.dss_branches import branches_of
from plant.imports.opendss.dss_elements import complex_of
from plant.imports.opendss.dss_engine import DssEngine

GENERATION = frozenset({"generator", "pvsystem", "storage"})
"""Classes that are taken over as the power that they deliver in the script's snapshot."""

IMPEDANCE = 2
"""Model whose power goes with the square of the voltage; that of the other models is constant within limits."""

CLOSE = 1e-6
"""Largest difference between the engine's current and that of the parts, beside the largest current."""


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
    is_delta = _property(element, "conn").lower().startswith(("d", "l"))
    branches = branches_of(element, float(_property(element, "kv")), is_delta=is_delta)
    across = np.array([V[start] - V[end] for start, end in branches.conductors])
    constant = int(_property(element, "model") or 1) != IMPEDANCE
    V_min, V_max = (float(_property(element, key)) for key in ("vminpu", "vmaxpu"))
    m = np.abs(across) / branches.V_nom
    inside = (m > V_min) & (m <= V_max)
    factor = np.where(inside, 1.0, (m / np.where(m <= V_min, V_min, V_max)) ** 2) if constant else m**2
    S = total / factor.sum()
    of_parts = np.zeros(current.size, complex)
    for (start, end), delivered in zip(branches.conductors, np.conj(S * factor / across), strict=True):
        of_parts[start] -= delivered
        of_parts[end] += delivered
    if np.abs(of_parts - current).max() > CLOSE * np.abs(current).max():
        problems.append(
            f"{name}: delivers no constant power, or not the same in each phase (a limit of its current, another "
            f'control); leave it out (leave_out=["{name}"]) or put an inverter there'
        )
        return []
    kW, kvar = (round(power / 1e3, 3) + 0.0 for power in (total.real, total.imag))
    kind = "constant" if constant else "as an impedance"
    notes.append(f"{name}: delivers the {kW:g} kW and {kvar:g} kvar of the snapshot, {kind}")
    return [
        LoadPart(
            name=name,
            bus=branches.bus,
            ends=ends,
            S=-S,
            V_nom=branches.V_nom,
            exponents=(0.0, 0.0) if constant else (2.0, 2.0),
            V_min=V_min if constant else 0.0,
            V_max=V_max if constant else 0.0,
        )
        for ends in branches.ends()
    ]


def _property(element: Any, key: str) -> str:
    return str(element.Properties(key).Val)
