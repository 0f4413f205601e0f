"""Reads and checks the CSV tables of a feeder. `plant/data/README.md` tells the layout."""

from gridpeers.plant.tables.read import FeederError, feeders, is_folder, load_sets, read_feeder

__all__ = ["FeederError", "feeders", "is_folder", "load_sets", "read_feeder"]
