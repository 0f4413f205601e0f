"""Load the plant's compiled step ahead of a plant: for the process from which plants are forked."""

from __future__ import annotations

from gridpeers.plant.build import build_plant
from gridpeers.plant.dynamics.kernel.compiled import is_compiled
from gridpeers.plant.dynamics.kernel.step import run_steps
from gridpeers.plant.plant_config import PlantConfig, PlantSettings


def load_kernels() -> None:
    """Build and step a plant of the feeder that comes with gridpeers, unless its step would have to be compiled.

    The first compilation takes up to a minute; it is for the plant's own process, which says that it compiles.
    """
    # a check compiles the operating point alone
    if not is_compiled(run_steps.__name__):
        return
    settings = PlantSettings()
    config = PlantConfig(
        run="none",
        settings=settings,
        agents=(),
        T_c=settings.h,
        end=None,
        record_step=settings.h,
        deadline=1.0,
        listen=(),
    )
    build_plant(config).advance()
