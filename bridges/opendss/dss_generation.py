"""Generators, photovoltaic systems and storage of an OpenDSS circuit, as the constant power that each delivers."""

from __future__ import annotations

from typing import Any

import numpy as np
from msgspec.structs import replace

from gridpeers.bridges.opendss.dss_branches import branches_of
from gridpeers.bridges.opendss.dss_elements import complex_of
from gridpeers.bridges.opendss.dss_engine import DssEngine
from gridpeers.plant.dynamics.kernel.solve import limited_admittance
from gridpeers.plant.equipment.imported_equipment import LoadPart, cut_off
from gridpeers.plant.network.loads import law_row

GENERATION = frozenset({"generator", "pvsystem", "storage"})
"""Classes that are taken over as the power that they deliver in the script's snapshot."""

IMPEDANCE = 2
"""Model whose power goes with the square of the voltage; that of the other models is constant within limits."""

NO_LIMITS, FIXED_Q, FIXED_X, LIMITED_CURRENT = 3, 4, 5, 7
"""Further models of a Generator; LimitCurrent=yes of PVSystem is the last one."""

CLOSE = 1e-6
"""Largest difference between the engine's current and that of the parts, beside the largest current."""


def read_generation(engine: DssEngine, name: str, notes: list[str], problems: list[str]) -> list[LoadPart]:
    """Return the parts of an element of `GENERATION`: loads of negative power, the same in each phase.

    The power is that of the engine's solution, the law beyond `vminpu` and `vmaxpu` that of the element's model.
    Above 1.2 pu it drops out, which the engine does not know. Problems take an element that the engine lets deliver
    another current (unequal phases, another control).
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
    m = np.abs(across) / branches.V_nom
    kind = _kind(element, name)
    laws = _laws(kind, *(float(_property(element, key)) for key in ("vminpu", "vmaxpu")))
    unit = LoadPart(name=name, bus=branches.bus, ends=("A", ""), S=1.0 + 0j, V_nom=branches.V_nom, exponents=(0.0, 0.0))
    S = np.zeros(across.size, complex)
    shares: list[LoadPart] = []
    for power, law in zip((complex(total.real), 1j * total.imag), laws, strict=True):
        share = replace(unit, **law)
        row = np.array(law_row(share))
        factor = np.array([limited_admittance(row, V)[0].real * V * V for V in np.abs(across).tolist()])
        nominal = power / factor.sum()
        S += nominal * factor
        if shares and laws[0] == law:
            shares[0] = replace(shares[0], S=shares[0].S - nominal)
        elif power:
            shares.append(replace(share, S=-nominal))
    of_parts = np.zeros(current.size, complex)
    for (start, end), delivered in zip(branches.conductors, np.conj(S / across), strict=True):
        of_parts[start] -= delivered
        of_parts[end] += delivered
    if np.abs(of_parts - current).max() > CLOSE * np.abs(current).max():
        problems.append(
            f"{name}: delivers no constant power, or not the same in each phase (another "
            f'control); leave it out (leave_out=["{name}"]) or put an inverter there'
        )
        return []
    kW, kvar = (round(power / 1e3, 3) + 0.0 for power in (total.real, total.imag))
    words = "as an impedance" if kind == IMPEDANCE else "constant"
    notes.append(f"{name}: delivers the {kW:g} kW and {kvar:g} kvar of the snapshot, {words}")
    off = cut_off(float(m.max())) if total.real > 0.0 else 0.0
    return [replace(share, ends=ends, V_off_above=off) for ends in branches.ends() for share in shares]


def _kind(element: Any, name: str) -> int:
    """Return the model of an element, as that of a Generator that has the same law.

    The engine does not limit the current of Storage, whatever its LimitCurrent is.
    """
    model = int(_property(element, "model") or 1)
    if name.startswith("generator."):
        return model
    limited = name.startswith("pvsystem.") and _property(element, "limitcurrent").lower().startswith(("y", "t"))
    return IMPEDANCE if model == IMPEDANCE else LIMITED_CURRENT if limited else 1


def _laws(kind: int, V_min: float, V_max: float) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the laws of P and of Q as fields of `LoadPart`."""
    constant: dict[str, Any] = {"exponents": (0.0, 0.0)}
    within = {**constant, "V_min": V_min, "V_max": V_max}
    impedance = {"exponents": (2.0, 2.0)}
    laws = {
        IMPEDANCE: (impedance, impedance),
        NO_LIMITS: (constant, constant),
        FIXED_Q: (within, {**within, "edge": 2.0}),
        FIXED_X: (within, impedance),
        LIMITED_CURRENT: 2 * ({**constant, "V_low": V_min, "V_min": V_min},),
    }
    return laws.get(kind, (within, within))


def _property(element: Any, key: str) -> str:
    return str(element.Properties(key).Val)
