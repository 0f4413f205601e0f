"""Loads of an OpenDSS circuit: each phase as parts whose power goes with a power of the voltage, within limits."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from gridpeers.bridges.opendss.dss_elements import complex_of, letter_of
from gridpeers.bridges.opendss.dss_engine import DssEngine
from gridpeers.plant.dynamics.kernel.solve import limited_admittance
from gridpeers.plant.equipment.imported_equipment import LoadPart, cut_off
from gridpeers.plant.network.loads import law_row


class Branches(NamedTuple):
    """The branches of an element, between its conductors."""

    bus: str
    """Bus of its terminal."""
    letters: list[str]
    """Letter of the node that each conductor leads to; empty for ground."""
    conductors: list[tuple[int, int]]
    """The two conductors of each branch."""
    V_nom: float
    """Nominal voltage across each (V)."""

    def ends(self) -> list[tuple[str, str]]:
        """Return the ends of each branch as `LoadPart` has them; none of a branch with both ends at one node."""
        pairs = [(self.letters[start], self.letters[end]) for start, end in self.conductors]
        return [(one, other) if one else (other, one) for one, other in pairs if one != other]


def branches_of(element: Any, kV: float, *, is_delta: bool) -> Branches:
    """Return the branches of a load or generator, which is active.

    `kV` is line-to-line in a delta and where a wye has two or three phases, else that of its phase. Phases of a delta
    are between its conductors, others between each and the last one.
    """
    phases, conductors = int(element.NumPhases), int(element.NumConductors)
    return Branches(
        bus=str(element.BusNames[0]).partition(".")[0].lower(),
        letters=[letter_of(node) for node in element.NodeOrder],
        conductors=[(k, (k + 1) % conductors if is_delta else phases) for k in range(phases)],
        V_nom=kV * 1e3 / sqrt(3.0) if not is_delta and phases in (2, 3) else kV * 1e3,
    )


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


GENERATION = frozenset({"generator", "pvsystem", "storage"})
"""Classes that are taken over as the power that they deliver in the script's snapshot."""

IMPEDANCE = 2
"""Model whose power goes with the square of the voltage; that of the other models is constant within limits."""

NO_LIMITS, OWN_Q, OWN_X, LIMITED_CURRENT = 3, 4, 5, 7
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
        OWN_Q: (within, {**within, "edge": 2.0}),
        OWN_X: (within, impedance),
        LIMITED_CURRENT: 2 * ({**constant, "V_low": V_min, "V_min": V_min},),
    }
    return laws.get(kind, (within, within))


def _property(element: Any, key: str) -> str:
    return str(element.Properties(key).Val)
