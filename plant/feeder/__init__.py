"""The feeder with its inverters, stepped a control period at a time. Pure."""

from gridpeers.plant.feeder.islands import GRID
from gridpeers.plant.feeder.plant import Plant
from gridpeers.plant.feeder.trips import raise_for_trip

__all__ = ["GRID", "Plant", "raise_for_trip"]
