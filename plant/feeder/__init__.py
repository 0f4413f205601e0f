"""The feeder with its inverters, stepped a control period at a time. Pure."""

from plant.feeder.islands import GRID
from plant.feeder.plant import Plant

__all__ = ["GRID", "Plant"]
