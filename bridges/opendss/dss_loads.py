"""Loads and generation of an OpenDSS circuit: each phase as parts whose power goes with a power of the voltage."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from gridpeers.bridges.feeder_import import FeederImport
from gridpeers.bridges.opendss.dss_engine import DssEngine, bus_of, complexes
from gridpeers.plant.dynamics.kernel.solve import limited_admittance
from gridpeers.plant.equipment import NODES
from gridpeers.plant.equipment.imported_equipment import LoadPart, cut_off
from gridpeers.plant.network.loads import law_row

Law = dict[str, Any]  # how power goes with the voltage, by the fields of `LoadPart`

CONSTANT: Law = {"exponents": (0.0, 0.0)}
IMPEDANCE: Law = {"exponents": (2.0, 2.0)}


class Branches(NamedTuple):
    """The branches of an element, between its conductors."""

    bus: str
    letters: list[str]  # letter of the node that each conductor leads to; empty for ground
    conductors: list[tuple[int, int]]  # the two conductors of each branch
    V_nom: float  # nominal voltage across each (V)

    def across(self, V: Any) -> Any:
        return np.array([V[start] - V[end] for start, end in self.conductors])

    def parts(self, name: str, laws: list[Law], V_off_above: float) -> list[LoadPart]:
        """Return a part of each law for each branch; none of a branch with both ends at one node."""
        pairs = [(self.letters[start], self.letters[end]) for start, end in self.conductors]
        return [
            LoadPart(
                name=name,
                bus=self.bus,
                ends=(one, other) if one else (other, one),
                V_nom=self.V_nom,
                V_off_above=V_off_above,
                **law,
            )
            for one, other in pairs
            if one != other
            for law in laws
        ]


def letter_of(node: int) -> str:
    """Return our letter of a bus's node of this number; ground, number 0, has none."""
    return NODES[node - 1] if node > 0 else ""


def branches_of(element: Any, kV: float, bus_names: Mapping[str, str], *, is_delta: bool) -> Branches:
    """Return the branches of a load or generator, which is active.

    `kV` is line-to-line in a delta and where a wye has two or three phases, else that of its phase. Phases of a delta
    are between its conductors, others between each and the last one.
    """
    phases, conductors = int(element.NumPhases), int(element.NumConductors)
    return Branches(
        bus=bus_names[bus_of(element.BusNames[0])],
        letters=[letter_of(node) for node in element.NodeOrder],
        conductors=[(k, (k + 1) % conductors if is_delta else phases) for k in range(phases)],
        V_nom=kV * 1e3 / sqrt(3.0) if not is_delta and phases in (2, 3) else kV * 1e3,
    )


EXPONENTS = {1: (0.0, 0.0), 2: (2.0, 2.0), 3: (0.0, 2.0), 5: (1.0, 1.0)}
"""With what power of the voltage P and Q go, by the load's `model`."""

CVR, FIXED_Q, FIXED_X, ZIP = 4, 6, 7, 8  # models that need more than exponents
ADMITTANCE = 2  # load model of a solution that makes an impedance of every load
VARIABLE = 0  # status of a load that the circuit's load multiplier scales


def read_loads(
    engine: DssEngine, left_out: set[str], bus_names: Mapping[str, str], found: FeederImport
) -> list[LoadPart]:
    """Return the parts of all loads that are enabled and not left out; a problem for each that cannot be represented.

    Of models 6 and 7 one thing is not taken over: that below `vlowpu` (half of the nominal voltage) they jump to
    another impedance.
    """
    parts: list[LoadPart] = []
    circuit, solution = engine.circuit, engine.circuit.Solution
    impedances, year = int(solution.LoadModel) == ADMITTANCE, int(solution.Year)
    growth = (1.0 + float(solution.pctGrowth) / 100.0) ** (year - 1) if year else 1.0
    for load in circuit.Loads:
        element = circuit.ActiveCktElement
        name = f"load.{str(load.Name).lower()}"
        if not element.Enabled or name in left_out or load.kW == load.kvar == 0.0:
            continue
        if int(load.Model) == FIXED_Q and load.kvar and not impedances:
            found.notes.append(
                f"{name}: model=6 takes less Q just below Vminpu, and more just above Vmaxpu: where its voltage "
                "crosses one of these limits, the power flow has no solution and an island is de-energised; use model=1"
            )
        if year and str(load.Growth):
            text = f"growth={load.Growth}: growth by a GrowthShape is not supported; leave out set year"
            found.refuse(name, text)
        scale = growth * (float(solution.LoadMult) if int(load.Status) == VARIABLE else 1.0)
        S = complex(load.kW, load.kvar) * 1e3 / int(element.NumPhases)
        if impedances:
            laws = [{"S": S * scale, **IMPEDANCE}]
        else:
            laws = _laws(name, load, float(element.Properties("vlowpu").Val or 0.5), S, scale, found)
        branches = branches_of(element, float(load.kV), bus_names, is_delta=bool(load.IsDelta))
        usual = np.abs(branches.across(complexes(element.Voltages))).max() / branches.V_nom
        parts += branches.parts(name, laws, cut_off(float(usual)) if load.kW < 0.0 else 0.0)
    return parts


def _laws(name: str, load: Any, V_low: float, S: complex, scale: float, found: FeederImport) -> list[Law]:
    """Return the laws of the parts of a load's phase, which takes this power (VA) before it is scaled."""
    model, V_min, V_max = int(load.Model), float(load.Vminpu), float(load.Vmaxpu)

    def law(
        S: complex, exponents: tuple[float, float], edge: float = 0.0, V_low: float = V_low, off: float = 0.0
    ) -> Law:
        if exponents == (2.0, 2.0) and not off:
            return {"S": S, **IMPEDANCE, "edge": edge}
        limits = {"V_low": V_low, "V_min": V_min if V_min > V_low else 0.0, "V_max": V_max}
        return {"S": S, "exponents": exponents, "edge": edge, "V_off": off, **limits}

    if model == ZIP:
        z = [float(value) for value in load.ZIPV]
        if len(z) < 7:
            found.refuse(name, f"model=8 needs zipv with seven numbers, got {len(z)}")
            return []
        S *= scale
        shares = [(complex(S.real * z[k], S.imag * z[k + 3]), n) for k, n in ((0, 2.0), (1, 1.0), (2, 0.0))]
        return [law(power, (n, n), edge=n, off=max(0.0, z[6])) for power, n in shares if power]
    if model in (FIXED_Q, FIXED_X):
        # Q is that of the script, whatever the multiplier; beyond the limits both are impedances
        n = 0.0 if model == FIXED_Q else 2.0
        return [
            law(complex(S.real * scale), (0.0, 0.0), V_low=0.0),
            law(complex(0.0, S.imag), (n, n), edge=2.0, V_low=0.0),
        ]
    exponents = (float(load.CVRwatts), float(load.CVRvars)) if model == CVR else EXPONENTS.get(model)
    if exponents is None:
        found.refuse(name, f"model={model} is not supported; the models are 1 to 8")
        return []
    return [law(S * scale, exponents, edge=1.0 if model == 5 else 0.0)]


GENERATION = frozenset({"generator", "pvsystem", "storage"})
"""Classes that are taken over as the power that they deliver in the script's snapshot."""

GENERATOR_LAWS = {2: "impedance", 3: "no limits", 4: "own Q", 5: "own X", 7: "limited current"}
"""Laws of a Generator by its model; those of the others are constant power within limits."""

CLOSE = 1e-6  # largest difference between the engine's current and that of the parts, beside the largest current


def read_generation(engine: DssEngine, name: str, bus_names: Mapping[str, str], found: FeederImport) -> list[LoadPart]:
    """Return the parts of an element of `GENERATION`: loads of negative power, the same in each phase.

    The power is that of the engine's solution, the law beyond `vminpu` and `vmaxpu` that of the element's model.
    Above 1.2 pu it drops out; the engine has no such limit. Problems take an element that the engine lets deliver
    another current (unequal phases, another control).
    """
    engine.circuit.SetActiveElement(name)
    element = engine.circuit.ActiveCktElement

    def read(key: str) -> str:
        return str(element.Properties(key).Val).lower()

    V, current = complexes(element.Voltages), complexes(element.Currents)
    total = complex(-np.sum(V * np.conj(current)))
    if abs(total) < 1.0:
        found.notes.append(f"{name}: delivers nothing; left out")
        return []
    branches = branches_of(element, float(read("kv")), bus_names, is_delta=read("conn").startswith(("d", "l")))
    across = branches.across(V)
    kind = GENERATOR_LAWS.get(int(read("model") or 1), "")
    if not name.startswith("generator."):  # the engine does not limit the current of Storage, whatever it says
        limited = name.startswith("pvsystem.") and read("limitcurrent").startswith(("y", "t"))
        kind = kind if kind == "impedance" else "limited current" if limited else ""
    V_min = float(read("vminpu"))
    within = {**CONSTANT, "V_min": V_min, "V_max": float(read("vmaxpu"))}
    limited_current = {**CONSTANT, "V_low": V_min, "V_min": V_min}
    law_of_P, law_of_Q = {
        "impedance": (IMPEDANCE, IMPEDANCE),
        "no limits": (CONSTANT, CONSTANT),
        "own Q": (within, {**within, "edge": 2.0}),
        "own X": (within, IMPEDANCE),
        "limited current": (limited_current, limited_current),
    }.get(kind, (within, within))
    unit = LoadPart(name=name, bus=branches.bus, ends=("A", ""), S=1.0 + 0j, V_nom=branches.V_nom, exponents=(0.0, 0.0))
    S = np.zeros(across.size, complex)
    laws: list[Law] = []
    for power, law in ((complex(total.real), law_of_P), (1j * total.imag, law_of_Q)):
        row = np.array(law_row(replace(unit, **law)))
        factor = np.array([limited_admittance(row, V)[0].real * V * V for V in np.abs(across).tolist()])
        nominal = power / factor.sum()
        S += nominal * factor
        if laws and law_of_P == law:
            laws[0]["S"] -= nominal
        elif power:
            laws.append({**law, "S": -nominal})
    of_parts = np.zeros(current.size, complex)
    for (start, end), delivered in zip(branches.conductors, np.conj(S / across), strict=True):
        of_parts[start] -= delivered
        of_parts[end] += delivered
    if np.abs(of_parts - current).max() > CLOSE * np.abs(current).max():
        found.refuse(
            name,
            "its power is not constant, or differs between phases (another control); "
            f"leave it out (--leave-out {name}), or add an inverter at its bus",
        )
        return []
    kW, kvar = (round(power / 1e3, 3) + 0.0 for power in (total.real, total.imag))
    words = "as an impedance" if kind == "impedance" else "constant"
    found.notes.append(f"{name}: delivers {kW:g} kW and {kvar:g} kvar as in the snapshot, {words}")
    usual = float(np.abs(across).max()) / branches.V_nom
    return branches.parts(name, laws, cut_off(usual) if total.real > 0.0 else 0.0)
