"""GridLAB-D's secondary-control autotest: its parameters, and its run with its own machines and its own controller.

An island of IEEE 123 with four machines and four inverters rests; then a load of 411 kW comes on at bus 251, and a
controller at bus 150 restores the frequency through two machines and two inverters.
"""

from __future__ import annotations

from math import sqrt

from bench.validation.delta_mode import COMPLEX, REAL, RecordedRun, delta_header, record
from bench.validation.machines import MACHINES, machine_blocks
from bench.validation.secondary_feeder import INVERTERS, island_tables
from bench.validation.secondary_law import AUTOTEST, SecondarySettings
from plant.equipment.inverter_parameters import GflParameters, GfmParameters
from plant.gridlabd.model.glm_block import block
from plant.gridlabd.model.glm_inverters import inverter_blocks
from plant.gridlabd.model.glm_network import network_blocks

H = 1e-3
"""Step (s)."""

SWITCH = "250-251"
"""It connects the load."""

GFM = GfmParameters(R_f=0.0025, X_f=0.05, P_max=1.2, k_pp=20.0, k_ip=60.0)
GFL = GflParameters(model="current_source", frequency_watt=False, volt_var=False, P_min=0.0, S_max=1.0, i_max=1.0)

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
    """Run it for some seconds after the load has come on.

    Raises
    ------
    RuntimeError
        If GridLAB-D fails.
    """
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
