"""The error of the plant's steps beside the integrated equations, the islanding alone (validation.md)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.dynamics.threads import one_thread
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, SwitchEvent
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from tests.validation.reference_dynamics import reference_plant

END = 0.3  # duration (s)
ROW = 0.004  # distance of the rows that are compared (s)
ISLANDING = (SwitchEvent(t=0.1, switch="13-152", action="open"),)


@one_thread()
def rows_of(h: float, make: Callable[[Network, PlantSettings, float, float], Plant]) -> NDArray[np.float64]:
    """Return rows x inverters x f (Hz), P, Q, V (pu) of case IV of the scenario islanding, its islanding at 0.1 s."""
    scenario, feeder = load_scenario("islanding")
    config, agents = configs(scenario, feeder, "IV")
    settings = replace(config.settings, h=h, events=ISLANDING)
    config = replace(config, settings=settings, record_step=ROW, end=END)
    network = Network(feeder)
    rows: list[tuple[float, ...]] = []
    plant = make(network, settings, config.T_c, ROW)
    assert not run_inprocess(config, agents, lambda sent: rows.extend(sent.rows), plant=plant).broke
    table = np.array(rows)[:, 1:].reshape(len(rows), len(network.inverters), -1)
    bases = [(1.0, unit.P_rated, unit.P_rated, unit.V_nom) for unit in network.inverters]
    return table[:, :, :4] / np.array(bases)


def test_the_error_falls_with_the_step() -> None:
    """Half a small step has half the error in every quantity, in closed loop."""
    exact = rows_of(ROW, reference_plant)

    coarse, fine = (np.abs(rows_of(h, Plant) - exact).max((0, 1)) for h in (0.00025, 0.000125))

    assert np.log2(coarse / fine).min() >= 0.8
