"""The plant: ``python -m plant < plant.json``. Exit statuses: see `wire.driver.process`."""

from __future__ import annotations

import sys

from plant.plant_config import PlantConfig
from plant.plant_process import run_plant
from wire.driver.process import main

if __name__ == "__main__":
    sys.exit(main("plant", "the feeder and its inverters", PlantConfig, run_plant))
