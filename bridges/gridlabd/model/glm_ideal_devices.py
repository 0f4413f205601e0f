"""Switches and regulators as GridLAB-D objects without impedance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from gridpeers.bridges.gridlabd.model.glm_block import TableRow, block

FEET_PER_MILE = 5280.0

Z_SWITCH, R_REGULATOR = complex(2**-10, 2**-10), 2**-10
"""Impedance of each phase of a closed switch and of a regulator (ohm): powers of two, so that it cancels to the bit."""


def compensations() -> list[str]:
    """Two kinds of line, which have the negative impedance of each phase of a switch and of a regulator per mile."""
    return [
        "// switches and regulators are ideal: behind each, a line has the negative of its impedance",
        *(
            block(
                "line_configuration",
                name=f"minus_{device}",
                **{f"z{i}{j}": -Z if i == j else 0j for i in (1, 2, 3) for j in (1, 2, 3)},
            )
            for device, Z in (("switch", Z_SWITCH), ("regulator", complex(R_REGULATOR)))
        ),
    ]


def _made_ideal(device: str, name: str, end: str, phases: str, V_nom: float) -> list[str]:
    """Return the node behind a device, and from there to the device's bus the line with its negative impedance.

    GridLAB-D needs an impedance for every closed switch and every regulator, and with less than 1e-4 ohm it does not
    solve the network to 1e-11 pu: rounding of such large admittances exceeds that. Together with its negative an
    impedance is exactly zero, and the matrix stays regular: the equation of the node between the two states that the
    voltages of both ends are equal.
    """
    return [
        block("node", name=f"m{name}", phases=phases, nominal_voltage=V_nom),
        block(
            "overhead_line",
            name=f"z{name}",
            from_=f"m{name}",
            to=f"n{end}",
            phases=phases,
            length=FEET_PER_MILE,
            configuration=f"minus_{device}",
        ),
    ]


def switch_blocks(rows: Iterable[TableRow], V_nom: Mapping[str, float], *, ideal: bool) -> list[str]:
    """Return the switches of a feeder, ideal or with GridLAB-D's default impedance."""
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


def regulator_blocks(rows: Iterable[TableRow], V_nom: Mapping[str, float], *, ideal: bool) -> list[str]:
    """Regulators at fixed taps, GridLAB-D's type A: V_to = (1 + tap tap_step) V_from."""
    R = {"regulator_resistance": R_REGULATOR} if ideal else {}
    taps: dict[tuple[str, str, str, float], dict[str, int]] = {}
    for row in rows:
        key = row["regulator"], row["from_bus"], row["to_bus"], float(row["tap_step_pu"])
        taps.setdefault(key, {}).update(dict.fromkeys(row["phases"], int(row["tap"])))
    blocks = []
    for (name, start, end, step), tap in taps.items():
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
                **{f"tap_pos_{phase}": at for phase, at in tap.items()},
            )
        )
        phases = "".join(sorted(tap)) + "N"
        blocks.append(
            block(
                "regulator",
                name=name,
                from_=f"n{start}",
                to=f"m{name}" if ideal else f"n{end}",
                phases=phases,
                configuration=f"c{name}",
                **R,
            )
        )
        if ideal:
            blocks += _made_ideal("regulator", name, end, phases, V_nom[end])
    return blocks
