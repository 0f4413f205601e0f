"""The plant, links emulated: ``python -m gridpeers.scenarios.emulation.emulated_plant < plant.json``; as `plant`."""

from __future__ import annotations

import sys

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_process import run_plant
from gridpeers.scenarios.emulation.emulated_links import links_of
from gridpeers.wire.driver.process import main


def run(config: PlantConfig) -> str:
    return run_plant(config, make_links=links_of)


if __name__ == "__main__":
    sys.exit(main("gridpeers.scenarios.emulation.emulated_plant", PlantConfig, run))
