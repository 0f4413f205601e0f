"""Build our plant from its configuration, or start the one of another simulator."""

from __future__ import annotations

from plant.feeder import Plant
from plant.network import Network
from plant.plant_config import PlantConfig
from plant.plant_interface import LivePlant
from plant.tables import read_feeder
from plant.tables.feeder_changes import changed


def start_plant(config: PlantConfig) -> LivePlant:
    """Start the plant of the configuration's simulator; its `close` ends it.

    Raises
    ------
    FeederError
        If the feeder's tables have problems.
    RuntimeError
        If it cannot start; the message says why, and what to do.
    """
    return build_plant(config)


def build_plant(config: PlantConfig) -> Plant:
    """Read the feeder and find the initial operating point of our own plant.

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
