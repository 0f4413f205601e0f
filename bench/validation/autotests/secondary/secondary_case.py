"""GridLAB-D's secondary-control autotest: its parameters.

An island of IEEE 123 with four machines and four inverters rests; then a load of 411 kW comes on at bus 251, and a
controller at bus 150 restores the frequency through two machines and two inverters.
"""

from __future__ import annotations

from bench.validation.autotests.secondary.machines import MACHINES
from plant.equipment.inverter_parameters import GflParameters, GfmParameters

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
