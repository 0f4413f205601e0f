"""Inverters on a network, stepped in time (`inverter-models.md` sections 2 to 7): the plant's numbers."""

from plant.dynamics.circuit import Circuit
from plant.dynamics.initial import PlantError
from plant.dynamics.simulation import Dynamics, Inverter

__all__ = ["Circuit", "Dynamics", "Inverter", "PlantError"]
