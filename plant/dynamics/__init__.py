"""Inverters on a network, stepped in time (`inverter-models.md` sections 2 to 7): the plant's numbers."""

from plant.dynamics.circuit import Circuit
from plant.dynamics.error import PlantError
from plant.dynamics.inverters import Inverter
from plant.dynamics.simulation import Dynamics
from plant.dynamics.switching import Trip

__all__ = ["Circuit", "Dynamics", "Inverter", "PlantError", "Trip"]
