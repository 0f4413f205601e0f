"""Inverters on a network, stepped in time."""

from gridpeers.plant.dynamics.circuit import Circuit, PlantError
from gridpeers.plant.dynamics.inverters import Inverter
from gridpeers.plant.dynamics.simulation import Dynamics, Trip

__all__ = ["Circuit", "Dynamics", "Inverter", "PlantError", "Trip"]
