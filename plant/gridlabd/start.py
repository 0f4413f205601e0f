"""Start GridLAB-D as the plant of a run."""

from __future__ import annotations

import tempfile
from pathlib import Path

from msgspec.structs import replace

from plant.equipment import Feeder
from plant.feeder import Plant
from plant.gridlabd.export_glm import write_tables
from plant.gridlabd.gridlabd_plant import GridlabdPlant
from plant.gridlabd.impedance import with_impedances
from plant.network import Network
from plant.plant_config import FeederChanges, PlantConfig


def start_gridlabd(config: PlantConfig, feeder: Feeder) -> GridlabdPlant:
    """Start GridLAB-D on a feeder; its closed switches and regulators have impedances, so its start has them too.

    Raises
    ------
    RuntimeError
        If there is no operating point, the wheel is missing, or GridLAB-D refuses the model.
    """
    assert config.end is not None, "a scenario in simulated time has an end"
    settings = config.settings
    ours = Plant(Network(with_impedances(feeder)), settings, config.T_c, config.record_step)
    with tempfile.TemporaryDirectory() as name:
        if settings.changes != FeederChanges():  # else GridLAB-D's model is written from the tables as they stand
            write_tables(feeder, Path(name))
            settings = replace(settings, feeder=name)
        return GridlabdPlant(
            ours,
            settings,
            config.T_c,
            config.end,
            record_step=config.record_step,
            deadline=0.8 * config.deadline,  # the plant tells the agents before they give it up
            network=Network(feeder),
        )
