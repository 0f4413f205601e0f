"""The feeder with its inverters, stepped a control period at a time. Pure."""

from plant.feeder.islands import GRID
from plant.feeder.plant import Plant
from plant.feeder.trips import raise_for_trip

__all__ = ["GRID", "Plant", "raise_for_trip"]
