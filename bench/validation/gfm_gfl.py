"""GridLAB-D's autotest of a grid-forming and a grid-following inverter, `test_inverter_dyn_GFM_GFL`, in both plants.

Six buses of 480 V; the GFM at Meter1, the GFL at Load2. The load at Load4 changes twice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.sparse as sp

from bench.validation.delta_mode import COMPLEX, REAL, Property, RecordedRun, delta_header, record
from gridpeers.bridges.gridlabd.glm import inverter_blocks
from gridpeers.bridges.gridlabd.glm_network import block
from gridpeers.plant.dynamics import Circuit, Dynamics, Inverter
from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop

H = 0.002
"""Step (s)."""

S_B = 200e3
"""Rating of either inverter (VA)."""

V_B = 277.1363
"""Nominal voltage (V, line-to-neutral)."""

SWING = (277.1363 + 0j, -138.5682 - 240j, -138.5682 + 240j)
"""Phasors at Meter1 at the start (V), of which the autotest has B and C rounded."""

M_P = 3.77 / (2.0 * np.pi * 60.0)
"""Droop of the GFM (pu): its mp is 3.77 rad/s per pu, not 1 % to the last digit."""

BUSES = ("Meter1", "Load1", "Load2", "Load3", "Meter3", "Load4")

LINES = (
    ("Meter1", "Load1", 0.01 + 0.01j, 0.0106 + 0.0103j),
    ("Load1", "Load2", 0.0035 + 0.0034j, 0.0035 + 0.0034j),
    ("Load2", "Load3", 0.0279 + 0.0115j, 0.0279 + 0.0115j),
    ("Meter1", "Meter3", 0.0189 + 0.0968j, 0.0189 + 0.0968j),
    ("Meter3", "Load4", 0.0350 + 0.0116j, 0.0350 + 0.0116j),
)
"""From, to, ohm of phase A, ohm of phases B and C."""

Z_LOAD1 = 2.42
"""Each phase (ohm)."""

Z_LOAD4 = (5.76, 2.304 + 4.608j, 2.304)
"""Each phase (ohm): at the start, and after each change."""

TERMINALS = {"GFM": "Meter1", "GFL": "Load2"}
"""Bus of each inverter."""

START_POWER = {"GFM": 60e3 + 0j, "GFL": 60e3 + 10e3j}
"""Powers at the start (VA); that of the GFM, which holds the voltage, is a first guess."""

GFM = GfmDroop(R_f=0.014, X_f=0.1636, P_max=1.0, k_pp=0.0, k_ip=90.9)
GFL = Gfl(X_f=0.10, F_current=0.0, T_ff=0.05, T_pf=0.5, T_vf=0.05, T_qf=0.2, S_max=1.0, i_max=1.0)


def gfm_gfl_circuit(z_load4: complex) -> Circuit:
    """Return the network with Load4 at this impedance (ohm)."""
    start = {bus: 3 * i for i, bus in enumerate(BUSES)}
    Y = np.zeros((18, 18), complex)
    for first, second, z_A, z_BC in LINES:
        for phase, z in enumerate((z_A, z_BC, z_BC)):
            i, j = start[first] + phase, start[second] + phase
            Y[[i, j], [i, j]] += 1.0 / z
            Y[[i, j], [j, i]] -= 1.0 / z
    for bus, z in (("Load1", Z_LOAD1), ("Load4", z_load4)):
        own = np.arange(start[bus], start[bus] + 3)
        Y[own, own] += 1.0 / z
    none = np.zeros(0, complex)
    return Circuit(
        Y=sp.csc_array(Y),
        sources=np.arange(0),
        source_voltage=none,
        terminals=np.array([[start[bus] + phase for phase in range(3)] for bus in TERMINALS.values()], np.int64),
        C=sp.csc_array((18, 0)),
        loads=LoadLaw(S=none, I0=none),
        V_branch=none,
    )


def gfm_gfl_dynamics(gfl: Gfl = GFL) -> Dynamics:
    """Return our plant of the case at rest, perhaps with another GFL."""
    units = (
        Inverter(name="GFM", kind="GFM", S_b=S_B, V_b=V_B, m_p=M_P, m_q=0.05, parameters=GFM),
        Inverter(name="GFL", kind="GFL", S_b=S_B, V_b=V_B, m_p=0.01, m_q=0.05, parameters=gfl),
    )
    dynamics = Dynamics(gfm_gfl_circuit(Z_LOAD4[0]), units, H)
    start = np.array(list(START_POWER.values())) / S_B
    dynamics.start(start.real, start.imag, swing_voltage=np.array(SWING, np.complex128) / V_B)
    return dynamics


SOLVER = ("default_maximum_voltage_error 1e-11",)

READ: Sequence[Property] = (
    ("GFM", "VA_Out", COMPLEX),
    ("GFL", "VA_Out", COMPLEX),
    ("GFM", "freq", REAL),
    ("GFL", "f_PLL_A", REAL),
)
"""Compared quantities, in the order of the inverters."""


def record_gfm_gfl(changes: Mapping[int, complex], steps: int) -> RecordedRun:
    """Run it; from each of the steps in `changes` on, Load4 has that impedance (ohm)."""
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
