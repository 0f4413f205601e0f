"""Build the plant from its configuration."""

from __future__ import annotations

from plant.feeder import Plant
from plant.network import Network
from plant.plant_config import PlantConfig
from plant.tables import read_feeder
from plant.tables.feeder_changes import changed


def build_plant(config: PlantConfig) -> Plant:
    """Read the feeder and find the initial operating point.

    Raises
    ------
    FeederError
        If the feeder's tables have problems.
    PlantError
        If there is no operating point.
    """
    settings = config.settings
    feeder = changed(read_feeder(settings.feeder, settings.load_set), settings.changes)
    network = Network(feeder, spares=settings.spares)
    return Plant(network, settings, config.T_c, config.record_step)
