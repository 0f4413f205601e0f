"""Start GridLAB-D as the plant of a run."""

from __future__ import annotations

from contextlib import closing

from msgspec.structs import replace

from gridpeers.bridges.gridlabd.gridlabd_plant import GridlabdPlant
from gridpeers.bridges.gridlabd.model.export_glm import write_tables
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import FeederChanges, PlantConfig
from gridpeers.plant.request_process import TransientFolder


def start_gridlabd(config: PlantConfig, feeder: Feeder) -> GridlabdPlant:
    """Start GridLAB-D on a feeder, with the powers of our operating point.

    Raises
    ------
    RuntimeError
        If there is no operating point, the wheel is missing, or GridLAB-D refuses the model.
    """
    assert config.end is not None, "a scenario in simulated time has an end"
    settings = config.settings
    ours = Plant(Network(feeder), settings, config.T_c, config.record_step)
    with closing(TransientFolder("gridpeers-tables-")) as folder:
        if settings.changes != FeederChanges():  # else GridLAB-D's model is written from the tables as they stand
            write_tables(feeder, folder.path)
            settings = replace(settings, feeder=str(folder.path))
        return GridlabdPlant(
            ours,
            settings,
            config.T_c,
            config.end,
            record_step=config.record_step,
            deadline=0.8 * config.deadline,  # the plant tells the agents before they give it up
        )
