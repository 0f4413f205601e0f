"""Inverters on a network, stepped in time (`inverter-models.md` sections 2 to 7): the plant's numbers."""

from gridpeers.plant.dynamics.circuit import Circuit, PlantError
from gridpeers.plant.dynamics.inverters import Inverter
from gridpeers.plant.dynamics.simulation import Dynamics, Trip

__all__ = ["Circuit", "Dynamics", "Inverter", "PlantError", "Trip"]
