"""A feeder's network as GridLAB-D objects, from rows of its tables: nodes, lines, switches, regulators, loads.

This file and `glm` read the tables by themselves and share no code with `gridpeers.plant.tables` and
`gridpeers.plant.network`, so that a problem there shows as a difference.
"""

from __future__ import annotations

import cmath
from collections.abc import Collection, Iterable, Mapping, Sequence
from math import pi, sqrt

TableRow = Mapping[str, str]  # A row of a table, by its columns

F_NOM = 60.0  # nominal frequency (Hz)
FOOT, MILE, FEET_PER_MILE = 0.3048e-3, 1.609344, 5280.0
"""Lengths (km): GridLAB-D takes lines in feet and impedances per mile."""

NOMINAL_ANGLE = {"A": 0.0, "B": -2 * pi / 3, "C": 2 * pi / 3, "AB": pi / 6, "BC": -pi / 2, "CA": 5 * pi / 6}
"""Nominal angle (rad) of the voltage across a load, from a phase to ground or between two phases."""

Z_SWITCH, R_REGULATOR = complex(2**-10, 2**-10), 2**-10
"""Impedance of each phase of a closed switch and of a regulator (ohm): powers of two, so that it cancels to the bit."""


def block(kind: str, **properties: str | int | float | complex) -> str:
    """Write an object; names end in an underscore where Python has a keyword. Reading a number gives the same bits."""
    lines = []
    for name, value in properties.items():
        if isinstance(value, complex):
            value = f"{value.real!r}{value.imag:+.17g}j"
        lines.append(f"\t{name.removesuffix('_')} {value if isinstance(value, str) else repr(value)};")
    return "\n".join((f"object {kind} {{", *lines, "}"))


def network_blocks(
    table: Mapping[str, Sequence[TableRow]],
    load_set: str,
    V_nom: Mapping[str, float],
    leaders: Collection[str],
    *,
    ideal: bool = True,
) -> list[str]:
    """Return the objects of a network, from its tables and the nominal voltages (V) of its buses.

    `leaders` are buses with a GFM. Closed switches and regulators have no impedance if `ideal`, as here, or else
    GridLAB-D's default ones.
    """
    return [
        *_buses(table["buses"], V_nom, table["source"][0], leaders),
        *_lines(table["lines"], table["line_configs"]),
        *(_compensations() if ideal else ()),
        *_switches(table.get("switches", ()), V_nom, ideal=ideal),
        *_regulators(table.get("regulators", ()), V_nom, ideal=ideal),
        *_transformers(table.get("transformers", ()), V_nom),
        *_loads(table[f"loads_{load_set}"], V_nom),
        *_capacitors(table.get("capacitors", ()), V_nom),
    ]


def _buses(
    rows: Iterable[TableRow], V_nom: Mapping[str, float], source: TableRow, leaders: Collection[str]
) -> list[str]:
    """Only a SWING, or a SWING_PQ where there is none, lets GridLAB-D keep an island alive."""
    blocks = []
    for row in rows:
        name, V = row["bus"], V_nom[row["bus"]]
        swing: dict[str, str | complex] = {"bustype": "SWING_PQ"} if name in leaders else {}
        if name == source["bus"]:
            turned = cmath.rect(float(source["V_pu"]) * V, float(source["angle_deg"]) * pi / 180)
            swing = {f"voltage_{phase}": turned * cmath.rect(1.0, NOMINAL_ANGLE[phase]) for phase in "ABC"}
            swing["bustype"] = "SWING"
        blocks.append(block("node", name=f"n{name}", phases=row["phases"] + "N", nominal_voltage=V, **swing))
    return blocks


def _lines(rows: Iterable[TableRow], configs: Iterable[TableRow]) -> list[str]:
    """Lines as a pi: series impedance (ohm per mile) and shunt capacitance (nF per mile)."""
    kinds: dict[str, dict[str, complex | float]] = {}
    for row in configs:
        per_mile = complex(float(row["R_ohm_per_km"]), float(row["X_ohm_per_km"])) * MILE
        nF = float(row["B_uS_per_km"]) * 1e-6 / (2 * pi * F_NOM) * 1e9 * MILE
        i, j = ("ABC".index(row[end]) + 1 for end in ("phase_1", "phase_2"))
        kind = kinds.setdefault(row["config"], {})
        kind |= {f"z{i}{j}": per_mile, f"z{j}{i}": per_mile, f"c{i}{j}": nF, f"c{j}{i}": nF}
    blocks = [block("line_configuration", name=f"c{config}", **kind) for config, kind in kinds.items()]
    for row in rows:
        start, end, feet = f"n{row['from_bus']}", f"n{row['to_bus']}", float(row["length_m"]) / 1e3 / FOOT
        blocks.append(_line(f"l{row['line']}", start, end, row["phases"] + "N", feet, f"c{row['config']}"))
    return blocks


def _line(name: str, start: str, end: str, phases: str, feet: float, config: str) -> str:
    return block("overhead_line", name=name, from_=start, to=end, phases=phases, length=feet, configuration=config)


def _compensations() -> list[str]:
    """Two kinds of line, which have the negative impedance of each phase of a switch and of a regulator per mile."""
    found = ["// switches and regulators are ideal: behind each, a line has the negative of its impedance"]
    for device, Z in (("switch", Z_SWITCH), ("regulator", complex(R_REGULATOR))):
        rows = {f"z{i}{j}": -Z if i == j else 0j for i in (1, 2, 3) for j in (1, 2, 3)}
        found.append(block("line_configuration", name=f"minus_{device}", **rows))
    return found


def _made_ideal(device: str, name: str, end: str, phases: str, V_nom: float) -> list[str]:
    """Return the node behind a device, and from there to the device's bus the line with its negative impedance.

    GridLAB-D needs an impedance for every closed switch and every regulator, and with less than 1e-4 ohm it does not
    solve the network to 1e-11 pu: rounding of such large admittances exceeds that. Together with its negative an
    impedance is exactly zero, and the matrix stays regular: the equation of the node between the two states that the
    voltages of both ends are equal.
    """
    return [
        block("node", name=f"m{name}", phases=phases, nominal_voltage=V_nom),
        _line(f"z{name}", f"m{name}", f"n{end}", phases, FEET_PER_MILE, f"minus_{device}"),
    ]


def _switches(rows: Iterable[TableRow], V_nom: Mapping[str, float], *, ideal: bool) -> list[str]:
    blocks = []
    Z = {"switch_resistance": Z_SWITCH.real, "switch_reactance": Z_SWITCH.imag} if ideal else {}
    for row in rows:
        start, end, phases = row["from_bus"], row["to_bus"], row["phases"] + "N"
        name = f"{start}-{end}"
        blocks.append(
            block(
                "switch",
                name=f"s{name}",
                from_=f"n{start}",
                to=f"m{name}" if ideal else f"n{end}",
                phases=phases,
                status=row["state"].upper(),
                operating_mode="BANKED",
                **Z,
            )
        )
        if ideal:
            blocks += _made_ideal("switch", name, end, phases, V_nom[end])
    return blocks


def _regulators(rows: Iterable[TableRow], V_nom: Mapping[str, float], *, ideal: bool) -> list[str]:
    """Regulators at fixed taps, GridLAB-D's type A: V_to = (1 + tap tap_step) V_from."""
    R = {"regulator_resistance": R_REGULATOR} if ideal else {}
    taps: dict[tuple[str, str, str, float], dict[str, int]] = {}
    for row in rows:
        key = row["regulator"], row["from_bus"], row["to_bus"], float(row["tap_step_pu"])
        taps.setdefault(key, {}).update(dict.fromkeys(row["phases"], int(row["tap"])))
    blocks = []
    for (name, start, end, step), tap in taps.items():
        phases, behind = "".join(sorted(tap)) + "N", f"m{name}" if ideal else f"n{end}"
        positions = {f"tap_pos_{phase}": at for phase, at in tap.items()}
        blocks.append(
            block(
                "regulator_configuration",
                name=f"c{name}",
                connect_type="WYE_WYE",
                Control="MANUAL",
                Type="A",
                raise_taps=16,
                lower_taps=16,
                regulation=16 * step,
                **positions,
            )
        )
        ends = {"from_": f"n{start}", "to": behind}
        blocks.append(block("regulator", name=name, **ends, phases=phases, configuration=f"c{name}", **R))
        if ideal:
            blocks += _made_ideal("regulator", name, end, phases, V_nom[end])
    return blocks


def _transformers(rows: Iterable[TableRow], V_nom: Mapping[str, float]) -> list[str]:
    """Three-phase transformers of equal connections on both sides, at the nominal voltages of their buses."""
    kinds = {"D-D": ("DELTA_DELTA", "ABCD"), "Yg-Yg": ("WYE_WYE", "ABCN")}
    blocks = []
    for row in rows:
        connection, phases = kinds[row["connection"]]
        name, start, end = (row[key] for key in ("transformer", "from_bus", "to_bus"))
        blocks.append(
            block(
                "transformer_configuration",
                name=f"ct{name}",
                connect_type=connection,
                power_rating=float(row["S_rated_kVA"]),
                primary_voltage=V_nom[start] * sqrt(3),
                secondary_voltage=V_nom[end] * sqrt(3),
                impedance=complex(float(row["R_percent"]), float(row["X_percent"])) / 100,
            )
        )
        ends = {"from_": f"n{start}", "to": f"n{end}"}
        blocks.append(block("transformer", name=f"t{name}", **ends, phases=phases, configuration=f"ct{name}"))
    return blocks


def _loads(rows: Iterable[TableRow], V_nom: Mapping[str, float]) -> list[str]:
    """Spot loads, each at a load object of its own below its bus."""
    blocks = []
    for number, row in enumerate(rows):
        ends = ("AB", "BC", "CA") if row["connection"] == "D" else ("A", "B", "C")
        V = V_nom[row["bus"]] * (sqrt(3) if row["connection"] == "D" else 1.0)
        values: dict[str, complex] = {}
        for end, letter in zip(ends, "abc", strict=True):
            S = complex(float(row[f"P_{letter}_kW"]), float(row[f"Q_{letter}_kvar"])) * 1e3
            if S and row["model"] == "P":
                values[f"constant_power_{end}"] = S
            elif S and row["model"] == "I":
                values[f"constant_current_{end}"] = (S / cmath.rect(V, NOMINAL_ANGLE[end])).conjugate()
            elif S:
                values[f"constant_impedance_{end}"] = V**2 / S.conjugate()
        blocks.append(_load(f"load{number}", row["bus"], V_nom, values))
    return blocks


def _capacitors(rows: Iterable[TableRow], V_nom: Mapping[str, float]) -> list[str]:
    blocks = []
    for number, row in enumerate(rows):
        V = float(row["V_rated_kV_LN"]) * 1e3
        Q = {phase: float(row[f"Q_{phase.lower()}_kvar"]) * 1e3 for phase in "ABC"}
        Z = {f"constant_impedance_{phase}": complex(0.0, -(V**2) / var) for phase, var in Q.items() if var}
        blocks.append(_load(f"bank{number}", row["bus"], V_nom, Z))
    return blocks


def _load(name: str, bus: str, V_nom: Mapping[str, float], values: Mapping[str, complex]) -> str:
    phases = "".join(sorted({phase for key in values for phase in key.rpartition("_")[2]})) + "N"
    return block("load", name=f"{name}_{bus}", parent=f"n{bus}", phases=phases, nominal_voltage=V_nom[bus], **values)
