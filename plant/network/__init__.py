"""The three-phase network of a feeder: nodes, switches, admittance matrix, islands, and its power flow."""

from gridpeers.plant.network.merging import Merge
from gridpeers.plant.network.network import Network
from gridpeers.plant.network.powerflow import solve_power_flow

__all__ = ["Merge", "Network", "solve_power_flow"]
