"""The plant: ``python -m gridpeers.plant < plant.json``. Exit statuses: see `gridpeers.wire.driver.process`."""

from __future__ import annotations

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_process import run_plant
from gridpeers.wire.driver.process import main

if __name__ == "__main__":
    main("gridpeers.plant", PlantConfig, run_plant)
