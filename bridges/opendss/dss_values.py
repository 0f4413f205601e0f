"""Values of a script that no element can have, and voltages that a load or a bus is hardly meant for."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from gridpeers.bridges.opendss.dss_script import FREQUENCY
from gridpeers.plant.equipment import PHASES
from gridpeers.plant.equipment.connectivity import Node
from gridpeers.plant.equipment.imported_equipment import LoadPart
from gridpeers.plant.tables.feeder_columns import Manifest
from gridpeers.wire.schema.table_schema import named

FAR = 1.5
"""Ratio of two voltages that only a lost factor explains, such as that between phases and to ground."""

DEAD = 0.01
"""Voltage (pu) below which nothing feeds a node, so that nothing can be said of it."""


def impossible_values(circuit: Any) -> list[str]:
    """Return a problem for each value with which no power flow has a solution; a circuit that has been read."""
    frequency = float(circuit.Solution.Frequency)
    text = named(Manifest, "f_nom_Hz").objection(frequency)
    problems = [f"{FREQUENCY}: {text}; correct Set DefaultBaseFrequency or Set Frequency"] if text else []
    for load in circuit.Loads if circuit.Loads.Count else ():
        if not circuit.ActiveCktElement.Enabled:
            continue
        name, kV = f"load.{str(load.Name).lower()}", float(load.kV)
        if not (kV > 0.0 and isfinite(kV)):
            problems.append(f"{name}: kv must be above 0, got {kV:g} kV; give the voltage of its bus")
        if not (isfinite(load.kW) and isfinite(load.kvar)):
            problems.append(f"{name}: kw and kvar must be numbers, got {load.kW:g} kW and {load.kvar:g} kvar")
    for bank in circuit.Capacitors if circuit.Capacitors.Count else ():
        if circuit.ActiveCktElement.Enabled and not bank.kV > 0.0:
            problems.append(f"capacitor.{str(bank.Name).lower()}: kv must be above 0, got {bank.kV:g} kV")
    transformers = circuit.Transformers
    for transformer in transformers if transformers.Count else ():
        if not circuit.ActiveCktElement.Enabled:
            continue
        for winding in range(1, transformer.NumWindings + 1):
            transformer.Wdg = winding
            for key, value, unit in (("kv", transformer.kV, "kV"), ("kva", transformer.kVA, "kVA")):
                if not (value > 0.0 and isfinite(value)):
                    problems.append(
                        f"transformer.{str(transformer.Name).lower()}: {key} of winding {winding} must be above 0, "
                        f"got {value:g} {unit}"
                    )
    return problems


def repeated_names(circuit: Any) -> list[str]:
    """Return a problem for each name that several elements have: the engine finds one of them alone by it."""
    names = Counter(str(name).lower() for name in circuit.AllElementNames)
    return [
        f"{name}: {count} elements have this name; names must differ (set AllowDuplicates=no tells where they stand)"
        for name, count in names.items()
        if count > 1 and not name.startswith("load.")  # loads are read one after the other, not by name
    ]


def unusual_voltages(circuit: Any, parts: Sequence[LoadPart], V: Mapping[Node, complex]) -> list[str]:
    """Return notes on loads whose `kv`, and buses whose voltage base, is far from the voltage that they have (V)."""
    strange: dict[str, str] = {}
    for part in parts:
        V_part = abs(V.get((part.bus, part.ends[0]), 0j) - V.get((part.bus, part.ends[1]), 0j))
        if V_part > DEAD * part.V_nom and not 1.0 / FAR <= V_part / part.V_nom <= FAR:
            strange.setdefault(part.name, f"{V_part / 1e3:.3g} kV across a part that kv makes {part.V_nom / 1e3:.3g}")
    notes = []
    if strange:
        notes.append(
            f"{_several(list(strange))}: has {next(iter(strange.values()))} kV; beyond Vminpu and Vmaxpu a load does "
            "not take its kw; correct kv, or what feeds it"
        )
    based: dict[str, float] = {}
    unbased = []
    for bus in dict.fromkeys(bus for bus, _ in V):
        circuit.SetActiveBus(bus)
        V_base = 1e3 * float(circuit.ActiveBus.kVBase)
        V_bus = float(np.max([abs(V.get((bus, letter), 0j)) for letter in PHASES]))
        if V_base <= 0.0:
            unbased.append(bus)
        elif V_bus > DEAD * V_base and not 1.0 / FAR <= V_bus / V_base <= FAR:
            based[bus] = V_bus / V_base
    if based:
        notes.append(
            f"bus {_several(list(based))}: has {next(iter(based.values())):.2g} times its voltage base; correct "
            "Set VoltageBases, or the kvs of a transformer"
        )
    if unbased:
        notes.append(
            f"bus {_several(unbased)}: without a voltage base, so that the voltage there counts as nominal; "
            "write Set VoltageBases=[...] and CalcVoltageBases"
        )
    return notes


def _several(names: Sequence[str]) -> str:
    """Return the first of several names, and how many more there are."""
    more = len(names) - 1
    return f"{names[0]} (and {more} more)" if more else names[0]
