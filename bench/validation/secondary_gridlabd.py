"""GridLAB-D's secondary-control autotest: its parameters, and its run with its own machines and its own controller.

An island of IEEE 123 with four machines and four inverters rests; then a load of 411 kW comes on at bus 251, and a
controller at bus 150 restores the frequency through two machines and two inverters.
"""

from __future__ import annotations

import tomllib
from math import sqrt
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from bench.validation.delta_mode import COMPLEX, REAL, RecordedRun, delta_header, record
from bench.validation.secondary_feeder import INVERTERS, island_tables
from gridpeers.bridges.gridlabd.glm import inverter_blocks
from gridpeers.bridges.gridlabd.glm_network import block, network_blocks
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop

Z_0, Z_2 = 0.005 + 0.05j, 0.0072 + 0.254j
"""Impedances of zero and negative sequence of a machine (pu), those of GridLAB-D's class."""

PHASES = np.exp(-2j * np.pi / 3.0 * np.arange(3))


class SecondarySettings(NamedTuple):
    """The settings of the autotest."""

    f_nom: float = 60.0
    """Hz."""
    dead_band: float = 0.001
    """Hz, to either side."""
    bias: float = 12.1187
    """B (MW/Hz)."""
    k_i: float = 0.04
    """Of the integrator (1/s)."""
    T: float = 0.1
    """Between two samples of the frequency (s)."""
    T_s: float = 0.2
    """Between two publications, and two samples of the powers (s)."""


AUTOTEST = SecondarySettings()


class Machine(msgspec.Struct, frozen=True):
    """A diesel machine.

    The plant has no machines. GridLAB-D simulates them (`diesel_dg`); for the plant each is its Norton equivalent: the
    admittance behind its subtransient reactances, and an injection that is replayed from GridLAB-D's run.
    """

    bus: str
    S_rated: float
    """Rating (VA)."""
    S_start: tuple[float, float]
    """Power of each phase at the start (W, var)."""
    own: dict[str, str | float] = {}
    """Its properties beside those of all machines, by GridLAB-D's names."""
    left_out: tuple[str, ...] = ()
    """Properties of all machines that it does not have."""

    @property
    def properties(self) -> dict[str, str | float]:
        """All its properties."""
        return {key: value for key, value in (_MACHINE | self.own).items() if key not in self.left_out}

    def admittance(self) -> NDArray[np.complex128]:
        """Return the admittance of its Norton equivalent (S, 3 x 3)."""
        base = float(self.properties["Rated_V"]) ** 2 / self.S_rated
        Z_1 = complex(float(self.properties["Ra"]), float(self.properties["Xdpp"]))
        sequences = np.column_stack([np.ones(3), PHASES, PHASES.conj()])
        Y: NDArray[np.complex128] = sequences @ np.diag(1.0 / (np.array([Z_0, Z_1, Z_2]) * base)) @ sequences.conj().T
        return Y / 3.0

    def power(self, V: NDArray[np.complex128], J: complex) -> complex:
        """Return what it delivers (VA) at its terminal's voltages (V) with its injection of phase A (A)."""
        return complex(np.vdot(J * PHASES - self.admittance() @ V, V))


_TABLES = tomllib.loads(Path(__file__).with_name("machines.toml").read_text(encoding="utf-8"))
_MACHINE: dict[str, str | float] = _TABLES.pop("machine")
MACHINES = msgspec.convert(_TABLES, dict[str, Machine])


H = 1e-3
"""Step (s)."""

SWITCH = "250-251"
"""It connects the load."""

GFM = GfmDroop(R_f=0.0025, X_f=0.05, P_max=1.2, k_pp=20.0, k_ip=60.0)
GFL = Gfl(model="current_source", frequency_watt=False, volt_var=False, P_min=0.0, S_max=1.0, i_max=1.0)

START_POWER = {"Inv1": 240e3 + 0j, "Inv2": 700e3 + 500e3j, "Inv3": 0j, "Inv4": 0j}
"""Powers of the inverters at the start (VA)."""

SHARES = {"Gen1": 0.3, "Gen4": 0.2, "Inv1": 0.2, "Inv3": 0.3}
"""Of the controller's output."""

LEAST_OF_GEN4 = 0.3
"""Its least set-point (pu); that of the others is 0."""

DEVICES = (*START_POWER, *MACHINES)
"""All sources: our inverters, then the machines."""

CONTROL_BUS = "150"
"""Where the controller measures the frequency; the bus of Gen1."""


NODE = {
    **{name: f"n{bus}" for name, (_, bus, _) in INVERTERS.items()},
    **{name: f"n{machine.bus}" for name, machine in MACHINES.items()},
}
"""Each device's node."""

INJECTION = "deltamode_generator_current_A"
"""A machine's Norton injection of phase A, a property of its node; it is balanced."""

FREQUENCY = {name: "freq" if kind == "GFM" else "f_PLL_A" for name, (kind, _, _) in INVERTERS.items()}
POWER = {name: "pwr_electric" if name in MACHINES else "VA_Out" for name in DEVICES}

SOLVER = (
    "NR_solver_algorithm FPI",  # the autotest's; the other one closes the switch onto a wrong voltage
    "default_maximum_voltage_error 1e-10",
    "all_frequency_measure_default PLL",
)


def record_secondary(seconds: float) -> RecordedRun:
    """Run it for some seconds after the load has come on."""
    steps = round(seconds / H) + 1
    injections = [(NODE[name], INJECTION, COMPLEX) for name in MACHINES]
    read = [
        *injections,
        *((name, key, COMPLEX) for name, key in POWER.items()),
        *((name, key, REAL) for name, key in FREQUENCY.items()),
        *((NODE[name], f"voltage_{phase}", COMPLEX) for name in DEVICES for phase in "ABC"),
        *((name, "pdispatch_offset", REAL) for name in SHARES),
        (f"n{CONTROL_BUS}", "measured_frequency", REAL),
    ]
    return record(_model(round(seconds) + 2), steps, read, injections, [(1, f"s{SWITCH}", "status", "close")])


def _model(seconds: int) -> str:
    tables = island_tables()
    V_nom = {row["bus"]: float(row["V_nom_kV_LL"]) * 1e3 / sqrt(3.0) for row in tables["buses"]}
    parameters = {row["name"]: GFM if row["kind"] == "GFM" else GFL for row in tables["inverters"]}
    blocks = (
        delta_header(H, seconds, f"n{CONTROL_BUS}", *SOLVER),
        *network_blocks(tables, "main", V_nom, {"151", "300"}, ideal=False),
        *machine_blocks(),
        *inverter_blocks(tables["inverters"], START_POWER, parameters),
        _controller(AUTOTEST),
    )
    return "\n".join(blocks)


def machine_blocks() -> list[str]:
    """Return the machines as GridLAB-D objects."""
    return [
        block(
            "diesel_dg",
            name=name,
            parent=f"n{machine.bus}",
            Rated_VA=machine.S_rated,
            **{f"power_out_{phase}": complex(*machine.S_start) for phase in "ABC"},
            **machine.properties,
        )
        for name, machine in MACHINES.items()
    ]


def _controller(settings: SecondarySettings) -> str:
    participants = {name: f"{name}, {share}" for name, share in SHARES.items()}
    participants["Gen4"] += f",,,,{LEAST_OF_GEN4}"
    return block(
        "sec_control",
        name="secondary",
        flags="DELTAMODE",
        parent=f"n{CONTROL_BUS}",
        deadband=settings.dead_band,
        B=settings.bias,
        kiPID=settings.k_i,
        kpPID=0.0,
        Ts=settings.T_s,
        Ts_P=settings.T_s,
        Ts_f=settings.T,
        anti_windup="FEEDBACK_PIDOUT",
        participant_input=f'"ADD {"; ".join(participants.values())}"',
    )
