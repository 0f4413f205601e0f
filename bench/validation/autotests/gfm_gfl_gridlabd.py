"""The autotest of a grid-forming and a grid-following inverter in GridLAB-D."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bench.validation.autotests.delta_header import delta_header
from bench.validation.autotests.gfm_gfl_case import (
    BUSES,
    GFL,
    GFM,
    LINES,
    M_P,
    S_B,
    START_POWER,
    SWING,
    TERMINALS,
    V_B,
    Z_LOAD1,
    Z_LOAD4,
    H,
)
from bench.validation.autotests.recorded_run import COMPLEX, REAL, Property, RecordedRun, record
from plant.gridlabd.model.glm_block import block
from plant.gridlabd.model.glm_inverters import inverter_blocks

SOLVER = ("default_maximum_voltage_error 1e-11",)

READ: Sequence[Property] = (
    ("GFM", "VA_Out", COMPLEX),
    ("GFL", "VA_Out", COMPLEX),
    ("GFM", "freq", REAL),
    ("GFL", "f_PLL_A", REAL),
)
"""Compared quantities, in the order of the inverters."""


def record_gfm_gfl(changes: Mapping[int, complex], steps: int) -> RecordedRun:
    """Run it; from each of the steps in `changes` on, Load4 has that impedance (ohm).

    Raises
    ------
    RuntimeError
        If GridLAB-D fails.
    """
    writes = [
        (step, "nLoad4", f"constant_impedance_{phase}", [z.real, z.imag])
        for step, z in changes.items()
        for phase in "ABC"
    ]
    return record(_model(round(steps * H) + 2), steps, READ, writes=writes)


def _model(seconds: int) -> str:
    rows = [
        {"name": name, "kind": name, "bus": bus, "P_rated_kW": repr(S_B / 1e3), "m_p_pu": repr(m_p), "m_q_pu": "0.05"}
        for (name, bus), m_p in zip(TERMINALS.items(), (M_P, 0.01), strict=True)
    ]
    impedances = {"Load1": complex(Z_LOAD1), "Load4": complex(Z_LOAD4[0])}
    return "\n".join(
        (
            delta_header(H, seconds, "nMeter1", *SOLVER),
            *(_bus(bus, impedances.get(bus)) for bus in BUSES),
            *(text for number, line in enumerate(LINES) for text in _line(number, *line)),
            *inverter_blocks(rows, START_POWER, {"GFM": GFM, "GFL": GFL}),
        )
    )


def _bus(name: str, z: complex | None) -> str:
    if z is not None:
        load = {f"constant_impedance_{phase}": z for phase in "ABC"}
        return block("load", name=f"n{name}", phases="ABCN", nominal_voltage=V_B, **load)
    swing: dict[str, str | complex] = {}
    if name == TERMINALS["GFM"]:
        swing = {"bustype": "SWING", **{f"voltage_{phase}": V for phase, V in zip("ABC", SWING, strict=True)}}
    return block("node", name=f"n{name}", phases="ABCN", nominal_voltage=V_B, **swing)


def _line(number: int, first: str, second: str, z_A: complex, z_BC: complex) -> tuple[str, str]:
    own = {"z11": z_A, "z22": z_BC, "z33": z_BC}
    none = {f"z{i}{j}": 0j for i in range(1, 4) for j in range(1, 4) if i != j}
    return (
        block("line_configuration", name=f"configuration{number}", **own, **none),
        block(
            "overhead_line",
            name=f"line{number}",
            phases="ABCN",
            from_=f"n{first}",
            to=f"n{second}",
            length="1 mile",
            configuration=f"configuration{number}",
        ),
    )
