"""Start GridLAB-D as the plant of a run."""

from __future__ import annotations

from plant.equipment import Feeder
from plant.feeder import Plant
from plant.network import Network
from plant.plant_config import PlantConfig

from .gridlabd_plant import GridlabdPlant
from .impedance import with_impedances


def start_gridlabd(config: PlantConfig, feeder: Feeder) -> GridlabdPlant:
    """Start GridLAB-D on a feeder; its closed switches and regulators have impedances, so its start has them too.

    Raises
    ------
    RuntimeError
        If there is no operating point, the wheel is missing, or GridLAB-D refuses the model.
    """
    assert config.end is not None, "a scenario in simulated time has an end"
    ours = Plant(Network(with_impedances(feeder)), config.settings, config.T_c, config.record_step)
    return GridlabdPlant(
        ours,
        config.settings,
        config.T_c,
        config.end,
        record_step=config.record_step,
        deadline=config.deadline,
        network=Network(feeder),
    )
