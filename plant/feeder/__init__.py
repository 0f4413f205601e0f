"""The feeder with its inverters, stepped a control period at a time. Pure."""

from gridpeers.plant.feeder.islands import raise_for_trip
from gridpeers.plant.feeder.plant import Plant
from tests.unit.scenarios.sweep.test_sweep_command import GRID

__all__ = ["GRID", "Plant", "raise_for_trip"]
