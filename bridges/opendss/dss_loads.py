"""Loads of an OpenDSS circuit: each phase as parts whose power goes with a power of the voltage, within limits."""

from __future__ import annotations

from typing import Any, NamedTuple

from gridpeers.bridges.opendss.dss_branches import branches_of
from gridpeers.bridges.opendss.dss_elements import complex_of
from gridpeers.bridges.opendss.dss_engine import DssEngine
from gridpeers.plant.equipment.imported_equipment import LoadPart, cut_off

EXPONENTS = {1: (0.0, 0.0), 2: (2.0, 2.0), 3: (0.0, 2.0), 5: (1.0, 1.0)}
"""With what power of the voltage P and Q go, by the load's `model`."""

CVR, FIXED_Q, FIXED_X, ZIP = 4, 6, 7, 8
"""Models that need more than exponents."""

ADMITTANCE = 2
"""Load model of a solution that makes an impedance of every load."""

VARIABLE = 0
"""Status of a load that the circuit's load multiplier scales."""


class Share(NamedTuple):
    """A part of each phase of a load, by the fields of `LoadPart`."""

    S: complex
    exponents: tuple[float, float]
    edge: float = 0.0
    V_low: float = 0.0
    V_off: float = 0.0


def read_loads(engine: DssEngine, left_out: set[str], notes: list[str], problems: list[str]) -> list[LoadPart]:
    """Return the parts of all loads that are enabled and not left out; a problem for each that cannot be represented.

    Of models 6 and 7 one thing is not taken over: that below `vlowpu` (half of the nominal voltage) they jump to
    another impedance.
    """
    parts: list[LoadPart] = []
    loads, circuit = engine.circuit.Loads, engine.circuit
    multiplier = float(circuit.Solution.LoadMult)
    impedances = int(circuit.Solution.LoadModel) == ADMITTANCE
    year = int(circuit.Solution.Year)
    growth = (1.0 + float(circuit.Solution.pctGrowth) / 100.0) ** (year - 1) if year else 1.0
    for load in loads:
        element = circuit.ActiveCktElement
        name = f"load.{str(load.Name).lower()}"
        if not element.Enabled or name in left_out:
            continue
        if load.kW == 0.0 and load.kvar == 0.0:
            continue
        if int(load.Model) == FIXED_Q and load.kvar and not impedances:
            notes.append(
                f"{name}: model=6 takes less Q just below Vminpu, and more just above Vmaxpu: where its voltage "
                "crosses one of them, no power flow has a solution, and an island is de-energised; model=1 has none"
            )
        if year and str(load.Growth):
            problems.append(
                f"{name}: growth={load.Growth}: growth by a GrowthShape is not supported; leave out set year"
            )
        scale = growth * (multiplier if int(load.Status) == VARIABLE else 1.0)
        parts += _parts(name, load, element, scale, impedances, problems)
    return parts


def _parts(name: str, load: Any, element: Any, scale: float, impedances: bool, problems: list[str]) -> list[LoadPart]:
    branches = branches_of(element, float(load.kV), is_delta=bool(load.IsDelta))
    shares = _shares(element, name, load, int(element.NumPhases), scale, impedances, problems)
    V_off_above = 0.0
    if load.kW < 0.0:
        V = complex_of(element.Voltages)
        V_off_above = cut_off(max(abs(V[start] - V[end]) for start, end in branches.conductors) / branches.V_nom)
    found = []
    for ends in branches.ends():
        for share in shares:
            limited = share.exponents != (2.0, 2.0) or share.V_off > 0.0
            found.append(
                LoadPart(
                    name=name,
                    bus=branches.bus,
                    ends=ends,
                    S=share.S,
                    V_nom=branches.V_nom,
                    exponents=share.exponents,
                    V_low=share.V_low if limited else 0.0,
                    V_min=float(load.Vminpu) if limited and float(load.Vminpu) > share.V_low else 0.0,
                    V_max=float(load.Vmaxpu) if limited else 0.0,
                    edge=share.edge,
                    V_off=share.V_off,
                    V_off_above=V_off_above,
                )
            )
    return found


def _shares(
    element: Any, name: str, load: Any, phases: int, scale: float, impedances: bool, problems: list[str]
) -> list[Share]:
    model, V_low = int(load.Model), float(element.Properties("vlowpu").Val or 0.5)
    S = complex(load.kW, load.kvar) * 1e3 / phases
    if impedances:
        return [Share(S * scale, (2.0, 2.0))]
    if model == ZIP:
        z = [float(value) for value in load.ZIPV]
        if len(z) < 7:
            problems.append(f"{name}: model=8 needs zipv with seven numbers, got {len(z)}")
            return []
        S *= scale
        parts = [(complex(S.real * z[k], S.imag * z[k + 3]), n) for k, n in ((0, 2.0), (1, 1.0), (2, 0.0))]
        return [Share(power, (n, n), n, V_low, max(0.0, z[6])) for power, n in parts if power]
    if model in (FIXED_Q, FIXED_X):
        # Q is that of the script, whatever the multiplier; beyond the limits both are impedances
        n = 0.0 if model == FIXED_Q else 2.0
        return [Share(complex(S.real * scale), (0.0, 0.0)), Share(complex(0.0, S.imag), (n, n), 2.0)]
    if model == CVR:
        return [Share(S * scale, (float(load.CVRwatts), float(load.CVRvars)), 0.0, V_low)]
    if model not in EXPONENTS:
        problems.append(f"{name}: model={model} is not supported; the models are 1 to 8")
        return []
    return [Share(S * scale, EXPONENTS[model], 1.0 if model == 5 else 0.0, V_low)]
