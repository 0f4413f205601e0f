"""The plant in simulated time: it grants ticks to its roster and waits for all of it. Pure."""

from plant.lockstep.core import PlantSide

__all__ = ["PlantSide"]
