"""The feeder of GridLAB-D's secondary-control autotest as tables: IEEE 123, islanded, with four inverters.

The tables are those of `standard123` with what the autotest changes: conductors and distances instead of published
impedances, no line charging, other loads and switches, and 2401.7 V as nominal voltage. Series impedances are those of
the modified Carson equations and Kron's reduction: 60 Hz, earth of 100 ohm m; ohm per mile, distances in feet (W. H.
Kersting, Distribution System Modeling and Analysis, 3rd ed., equations (4.39), (4.40), (4.55), (4.89) to (4.93)).
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from math import log, pi, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

import plant
from plant.equipment import Bus, Feeder, Line, LineConfig

F, EARTH = 60.0, 100.0

Impedance = NDArray[np.complex128]


class Conductor(NamedTuple):
    """One wire."""

    R: float
    """Resistance (ohm per mile)."""
    gmr: float
    """Geometric mean radius (ft)."""


def overhead_impedance(
    between: Sequence[Sequence[float]], to_neutral: Sequence[float], phase: Conductor, neutral: Conductor
) -> Impedance:
    """Return the impedance of a line with one neutral wire.

    Parameters
    ----------
    between
        Distances between the phases (ft), n x n.
    to_neutral
        Distances from the phases to the neutral (ft).
    phase, neutral
        Their wires.
    """
    n = len(to_neutral)
    Z = np.empty((n + 1, n + 1), complex)
    for i in range(n):
        Z[i, i], Z[i, n], Z[n, i] = _own(phase), _mutual(to_neutral[i]), _mutual(to_neutral[i])
        for j in range(n):
            if i != j:
                Z[i, j] = _mutual(between[i][j])
    Z[n, n] = _own(neutral)
    return _reduced(Z, n)


def cable_impedance(
    positions: Sequence[float], phase: Conductor, strand: Conductor, strands: int, radius: float
) -> Impedance:
    """Return the impedance of parallel cables with concentric neutrals.

    Parameters
    ----------
    positions
        Places of the cables along a line (ft).
    phase, strand
        The core and one strand of the neutral.
    strands, radius
        How many strands there are, and on which circle (ft).
    """
    n = len(positions)
    neutral = Conductor(strand.R / strands, (strand.gmr * strands * radius ** (strands - 1)) ** (1.0 / strands))
    Z = np.empty((2 * n, 2 * n), complex)
    for i in range(2 * n):
        for j in range(2 * n):
            a, b = i % n, j % n
            if i == j:
                Z[i, i] = _own(phase if i < n else neutral)
            else:
                Z[i, j] = _mutual(radius if a == b else abs(positions[a] - positions[b]))
    return _reduced(Z, n)


def _own(wire: Conductor) -> complex:
    return wire.R + _mutual(wire.gmr)


def _mutual(distance: float) -> complex:
    return complex(0.00158836 * F, 0.00202237 * F * (log(1.0 / distance) + 7.6786 + log(EARTH / F) / 2.0))


def _reduced(Z: Impedance, n: int) -> Impedance:
    """Return the impedance of the first n wires, with the others at zero voltage."""
    reduced: Impedance = Z[:n, :n] - Z[:n, n:] @ np.linalg.solve(Z[n:, n:], Z[n:, :n])
    return reduced


V_NOM = 2401.7
"""Nominal voltage (V, line-to-neutral)."""

MILE = 1.609344
"""In km."""

Row = dict[str, str]
Tables = dict[str, list[Row]]

TABLES = Path(plant.__file__).parent / "data" / "standard123"

ACSR_336, ACSR_1_0, ACSR_4_0 = Conductor(0.306, 0.0244), Conductor(1.12, 0.00446), Conductor(0.592, 0.00814)

AT_POLE = {"left": 5.656854, "middle": 4.272002, "right": 5.0}
"""Distance to the neutral (ft) from the three places on the cross-arm, which are 2.5 and 4.5 ft apart."""

APART = {frozenset(("left", "middle")): 2.5, frozenset(("middle", "right")): 4.5, frozenset(("left", "right")): 7.0}

PLACES = {
    "1": {"A": "left", "B": "middle", "C": "right"},
    "2": {"A": "middle", "B": "right", "C": "left"},
    "3": {"A": "right", "B": "left", "C": "middle"},
    "4": {"A": "right", "B": "middle", "C": "left"},
    "5": {"A": "middle", "B": "left", "C": "right"},
    "6": {"A": "left", "B": "right", "C": "middle"},
    "7": {"A": "left", "C": "right"},
    "8": {"A": "left", "B": "right"},
}
"""Where each phase of a configuration hangs."""

SINGLE_PHASE = {"9": ("A", ACSR_1_0), "10": ("B", ACSR_336), "11": ("C", ACSR_336)}
"""Phase and wire, also of the neutral 5 ft away; the autotest has larger wires than IEEE in 10 and 11."""

WITHOUT_LOAD = {"50", "66", "99", "102", "103", "104", "106", "107", "109", "111", "114"}

BALANCED_LOADS = {"42": 20 + 10j, "101": 90.001 + 43.334j, "251": 137 + 45j}
"""Constant power on each phase (kVA); 251 is the load that the event connects."""

CAPACITOR_X = {200.0: 28.8427, 50.0: 115.7067}
"""Reactance (ohm) of the banks, by their kvar."""

INVERTERS = {
    "Inv1": ("GFL", "18", 350.0),
    "Inv2": ("GFM", "151", 1000.0),
    "Inv3": ("GFL", "105", 500.0),
    "Inv4": ("GFM", "108", 500.0),
}
"""Kind, bus and rating (kW)."""


def island_tables() -> Tables:
    """Return the tables with the load at 251 switched off; a machine stands in for the substation of `source`."""
    tables = {path.stem: _read(path) for path in sorted(TABLES.glob("*.csv")) if path.stem != "published_voltages"}
    tables["line_configs"] = line_configs()
    for line in tables["lines"]:
        if {line["from_bus"], line["to_bus"]} == {"51", "151"}:
            line["length_m"] = repr(700 * 0.3048)
    for bus in tables["buses"]:
        if float(bus["V_nom_kV_LL"]) > 1.0:
            bus["V_nom_kV_LL"] = repr(V_NOM * sqrt(3.0) / 1e3)
    tables["buses"].append(tables["buses"][0] | {"bus": "251", "phases": "ABC"})
    tables["loads_main"] = _loads(tables["loads_main"])
    for bank in tables["capacitors"]:
        for key in ("Q_a_kvar", "Q_b_kvar", "Q_c_kvar"):
            if Q := float(bank[key]):
                bank[key] = repr(V_NOM**2 / CAPACITOR_X[Q] / 1e3)
        bank["V_rated_kV_LN"] = repr(V_NOM / 1e3)
    _set_switch(tables, "97", "197", "open")
    _set_switch(tables, "151", "300", "closed")
    _set_switch(tables, "250", "251", "open")
    tables["inverters"] = [
        {
            "name": name,
            "kind": kind,
            "bus": bus,
            "microgrid": "island",
            "P_rated_kW": repr(kW),
            # its mp is 3.77 rad/s per pu, not 1 % to the last digit; the GFL have no droop in use
            "m_p_pu": repr(3.77 / (2.0 * pi * 60.0)),
            "m_q_pu": "0.05",
        }
        for name, (kind, bus, kW) in INVERTERS.items()
    ]
    return tables


def line_configs() -> list[Row]:
    """Return the autotest's impedances as a table."""
    rows = []
    for name, (phases, Z) in _impedances().items():
        for i, first in enumerate(phases):
            for j, second in enumerate(phases[i:], i):
                per_km = complex(Z[i, j]) / MILE
                numbers = {"R_ohm_per_km": per_km.real, "X_ohm_per_km": per_km.imag, "B_uS_per_km": 0.0}
                ends = {"config": name, "phase_1": first, "phase_2": second}
                rows.append(ends | {key: repr(number) for key, number in numbers.items()})
    return rows


def write_tables(tables: Tables, folder: Path) -> None:
    """Write tables as the CSV files of a feeder."""
    for name, rows in tables.items():
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


def _read(path: Path) -> list[Row]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _set_switch(tables: Tables, first: str, second: str, state: str) -> None:
    for switch in tables["switches"]:
        if {switch["from_bus"], switch["to_bus"]} == {first, second}:
            switch["state"] = state
            return
    given = {"from_bus": first, "to_bus": second, "phases": "ABC", "state": state}
    tables["switches"].append(dict.fromkeys(tables["switches"][0], "") | given)


def _loads(rows: list[Row]) -> list[Row]:
    """Return the loads: their impedances and currents keep the values that they have at 4160 V."""
    ratio = V_NOM * sqrt(3.0) / 4160.0
    factor = {"P": 1.0, "I": ratio, "Z": ratio**2}
    powers = [key for key in rows[0] if key.startswith(("P_", "Q_"))]
    loads = []
    for row in rows:
        if row["bus"] not in WITHOUT_LOAD | set(BALANCED_LOADS):
            load = row | {key: repr(float(row[key]) * factor[row["model"]]) for key in powers}
            loads.append(load | {"Q_c_kvar": "25"} if row["bus"] == "49" else load)
    for bus, S in BALANCED_LOADS.items():
        power = {key: repr(S.real if key.startswith("P_") else S.imag) for key in powers}
        loads.append(rows[0] | {"bus": bus, "connection": "Y", "model": "P"} | power)
    return loads


def _impedances() -> dict[str, tuple[str, Impedance]]:
    """Return phases and impedance (ohm per mile) of each configuration."""
    impedances = {}
    for name, place in PLACES.items():
        phases = "".join(sorted(place))
        between = [[APART.get(frozenset((place[i], place[j])), 0.0) for j in phases] for i in phases]
        to_neutral = [AT_POLE[place[phase]] for phase in phases]
        if name == "2":  # the autotest has A and B of this configuration the other way round, to the neutral alone
            to_neutral[0], to_neutral[1] = to_neutral[1], to_neutral[0]
        impedances[name] = phases, overhead_impedance(between, to_neutral, ACSR_336, ACSR_4_0)
    for name, (phase, wire) in SINGLE_PHASE.items():
        impedances[name] = phase, overhead_impedance([[0.0]], [5.0], wire, wire)
    core = Conductor(0.97, 0.0111)
    radius = (1.06 - 0.0640837) / 24.0
    impedances["12"] = "ABC", cable_impedance((0.0, 0.5, 1.0), core, core, 6, radius)
    return impedances


Z_SWITCH = 1e-4 - 1e-4j
"""Of each phase of a closed switch (ohm); found by fitting, good to 1e-9 ohm."""

Z_REGULATOR = 1e-4 + 0j
"""Of each phase of a regulator, on its regulated side (ohm): GridLAB-D's `default_resistance`."""


def with_impedances(feeder: Feeder) -> Feeder:
    """Give the feeder with an impedance in series with every switch and every regulator."""
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
    phases: dict[tuple[str, str], str] = {}
    lines: list[Line] = []

    def between(device: str, bus: str, phase: str, config: str) -> str:
        """Put the impedance between a device and its bus; returns the new bus, where the device goes."""
        new = f"{device}~{bus}"
        phases[new, bus] = "".join(sorted(phases.get((new, bus), "") + phase))
        lines.append(Line(name=f"{new} {phase}", from_bus=new, to_bus=bus, phases=phase, config=config, length=1.0))
        return new

    switches = tuple(
        replace(switch, from_bus=between(switch.name, switch.from_bus, switch.phases, "switch"))
        for switch in feeder.switches
    )
    regulators = tuple(
        replace(unit, to_bus=between(unit.name, unit.to_bus, unit.phases, "regulator")) for unit in feeder.regulators
    )
    buses = tuple(Bus(name=new, phases=of, V_nom=V_nom[bus]) for (new, bus), of in phases.items())
    configs = (_config("switch", Z_SWITCH), _config("regulator", Z_REGULATOR))
    return replace(
        feeder,
        buses=(*feeder.buses, *buses),
        lines=(*feeder.lines, *lines),
        line_configs=(*feeder.line_configs, *configs),
        switches=switches,
        regulators=regulators,
    )


def _config(name: str, Z: complex) -> LineConfig:
    """Give a kind of line with this impedance per km, without coupling between its phases."""
    series = tuple(tuple(Z if i == j else 0j for j in range(3)) for i in range(3))
    return LineConfig(name=name, phases="ABC", Z=series, B=((0.0,) * 3,) * 3)
