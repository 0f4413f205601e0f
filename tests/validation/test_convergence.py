"""The error of both methods of time stepping beside the integrated equations, the islanding alone."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from msgspec.structs import replace
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import Method, PlantSettings, SwitchEvent
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from tests.validation.reference_dynamics import reference_plant

END = 0.3  # duration (s)
ROW = 0.004  # distance of the rows that are compared (s)
ISLANDING = (SwitchEvent(t=0.1, switch="13-152", action="open"),)


@cache
def rows_of(
    make: Callable[[Network, PlantSettings, float, float], Plant], method: Method, h: float
) -> NDArray[np.float64]:
    """Return rows x inverters x f (Hz), P, Q, V (pu) of case IV of the scenario islanding, its islanding at 0.1 s."""
    scenario, feeder = load_scenario("islanding")
    config, agents = configs(scenario, feeder, "IV")
    settings = replace(config.settings, h=h, method=method, events=ISLANDING)
    config = replace(config, settings=settings, record_step=ROW, end=END)
    network = Network(feeder)
    rows: list[tuple[float, ...]] = []
    plant = make(network, settings, config.T_c, ROW)
    with threadpool_limits(1):  # the reference has dense factors, which threads of BLAS make slower
        assert not run_inprocess(config, agents, lambda sent: rows.extend(sent.rows), plant=plant).broke
    table = np.array(rows)[:, 1:].reshape(len(rows), len(network.inverters), -1)
    bases = [(1.0, unit.P_rated, unit.P_rated, unit.V_nom) for unit in network.inverters]
    return table[:, :, :4] / np.array(bases)


def error(method: Method, h: float) -> NDArray[np.float64]:
    """Return the largest errors of f (Hz), P, Q, V (pu) over all rows and inverters at a step of h (s)."""
    return np.abs(rows_of(Plant, method, h) - rows_of(reference_plant, "second-order", ROW)).max((0, 1))


@pytest.mark.parametrize(("method", "h", "order"), [("first-order", 0.00025, 0.8), ("second-order", 0.001, 1.7)])
def test_the_error_falls_with_the_order_of_the_method(method: Method, h: float, order: float) -> None:
    """Of every quantity, in closed loop, at steps that are small, but above the error of the reference."""
    assert np.log2(error(method, h) / error(method, h / 2.0)).min() >= order


def test_the_second_order_method_errs_less_at_2_ms_than_the_default_at_a_quarter() -> None:
    """At most a fifth of the error (Hz, pu); and its limit at small steps is scipy's solution."""
    assert (error("second-order", 0.002) / error("first-order", 0.00025)).max() <= 0.2
    assert error("second-order", 0.000125).max() <= 2e-5
