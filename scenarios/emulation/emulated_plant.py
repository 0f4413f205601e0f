"""The plant behind emulated links: ``python -m scenarios.emulation.emulated_plant < plant.json``; else as `plant`."""

from __future__ import annotations

import sys

from plant.plant_config import PlantConfig
from plant.plant_process import run_plant
from scenarios.emulation.emulated_links import links_of
from wire.driver.process import main


def run(config: PlantConfig) -> str:
    """Run the plant; return why the run broke, or ""."""
    return run_plant(config, make_links=links_of)


if __name__ == "__main__":
    sys.exit(main("scenarios.emulation.emulated_plant", "the plant behind emulated links", PlantConfig, run))
