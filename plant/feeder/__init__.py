"""The feeder with its inverters, stepped a control period at a time. Pure."""

from gridpeers.plant.feeder.islands import GRID, raise_for_trip
from gridpeers.plant.feeder.plant import Plant

__all__ = ["GRID", "Plant", "raise_for_trip"]
