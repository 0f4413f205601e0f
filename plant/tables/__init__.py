"""Reads and checks the CSV tables of a feeder. `plant/data/README.md` tells the layout."""

from plant.tables.read import FeederError, feeders, load_sets, read_feeder

__all__ = ["FeederError", "feeders", "load_sets", "read_feeder"]
