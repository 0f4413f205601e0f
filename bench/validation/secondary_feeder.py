"""The feeder of GridLAB-D's secondary-control autotest as tables: IEEE 123, islanded, with four inverters.

The tables are those of `standard123` with what the autotest changes: other impedances of lines, no line charging, other
loads and switches, and 2401.7 V as nominal voltage. secondary_line_configs.csv has the impedances that GridLAB-D
computes from the autotest's conductors and distances: the modified Carson equations and Kron's reduction, 60 Hz, earth
of 100 ohm m (W. H. Kersting, Distribution System Modeling and Analysis, 3rd ed., equations (4.39), (4.40), (4.55),
(4.89) to (4.93)). Configurations 1 and 3 to 8 are IEEE's to the four digits that are published.
"""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import pandas as pd
from msgspec.structs import replace

import gridpeers.plant
from gridpeers.plant.equipment import Bus, Line, LineConfig, Tables

V_NOM = 2401.7
"""Nominal voltage (V, line-to-neutral)."""

Row = dict[str, str]
IslandTables = dict[str, list[Row]]

TABLES = Path(gridpeers.plant.__file__).parent / "data" / "standard123"

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


def island_tables() -> IslandTables:
    """Return the tables with the load at 251 switched off; a machine replaces the substation of `source`."""
    tables = {path.stem: _read(path) for path in sorted(TABLES.glob("*.csv")) if path.stem != "published_voltages"}
    tables["line_configs"] = _read(Path(__file__).with_name("secondary_line_configs.csv"))
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


def write_tables(tables: IslandTables, folder: Path) -> None:
    """Write tables as the CSV files of a feeder."""
    for name, rows in tables.items():
        pd.DataFrame(rows).to_csv(folder / f"{name}.csv", index=False)


def _read(path: Path) -> list[Row]:
    rows: list[Row] = pd.read_csv(path, dtype=str, keep_default_na=False).to_dict("records")
    return rows


def _set_switch(tables: IslandTables, first: str, second: str, state: str) -> None:
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


# ---------------------------------------------------------------- impedances of switches and regulators

Z_SWITCH = 1e-4 - 1e-4j
"""Of each phase of a closed switch (ohm); found by fitting, good to 1e-9 ohm."""

Z_REGULATOR = 1e-4 + 0j
"""Of each phase of a regulator, on its regulated side (ohm): GridLAB-D's `default_resistance`."""


def with_impedances(feeder: Tables) -> Tables:
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
