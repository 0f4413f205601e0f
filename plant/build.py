"""From the plant's configuration to the plant."""

from __future__ import annotations

from plant.config import PlantConfig
from plant.feeder import Plant
from plant.network import Network
from plant.tables import read_feeder


def build_plant(config: PlantConfig) -> Plant:
    """Read the feeder and find the operating point to start from.

    Raises
    ------
    FeederError
        If the feeder's tables have mistakes.
    PlantError
        If there is no operating point.
    """
    settings = config.settings
    network = Network(read_feeder(settings.feeder, settings.load_set), spares=settings.spares)
    return Plant(network, settings, config.T_c, config.record_step)
