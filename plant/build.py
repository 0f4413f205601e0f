"""Build our plant from its configuration, or start the one of another simulator."""

from __future__ import annotations

from gridpeers.plant.dynamics.kernel.compiled import is_compiled
from gridpeers.plant.dynamics.kernel.step import run_steps
from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.derived_feeders import changed
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantConfig, PlantSettings
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.plant.simulators import OURS, SIMULATORS
from gridpeers.plant.tables import read_feeder


def start_plant(config: PlantConfig) -> PlantLike:
    """Start the plant of the configuration's simulator; its `close` ends it.

    FeederError for bad tables; RuntimeError if it cannot start: it says why, and what to do.
    """
    if config.settings.simulator == OURS:
        return build_plant(config)
    return SIMULATORS.resolve(config.settings.simulator).start(config, _feeder(config))


def build_plant(config: PlantConfig) -> Plant:
    """Find the initial operating point of our own plant, and load its step; FeederError or PlantError if it cannot."""
    plant = plant_at_rest(config)
    plant.load_step()
    return plant


def plant_at_rest(config: PlantConfig) -> Plant:
    """Return our plant at its initial operating point, without compiling the step."""
    network = Network(_feeder(config), spares=config.settings.spares)
    return Plant(network, config.settings, config.T_c, config.record_step)


def _feeder(config: PlantConfig) -> Tables:
    settings = config.settings
    return changed(read_feeder(settings.feeder, settings.load_set), settings.changes)


def load_kernels() -> None:
    """Build and step a plant of our feeder, unless its step would have to be compiled, which takes up to a minute."""
    if is_compiled(run_steps.__name__):  # a check compiles the operating point alone
        settings = PlantSettings()
        network = Network(read_feeder(settings.feeder, settings.load_set))
        Plant(network, settings, settings.h, settings.h).advance()
