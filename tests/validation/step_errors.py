"""The error of a run of the microgrid feeder at several steps, beside the integrated equations."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import Method, PlantConfig, SwitchEvent
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from tests.validation.reference_dynamics import reference_plant

STEPS = (0.004, 0.002, 0.001, 0.0005, 0.00025, 0.000125)  # integration steps h (s); rows are compared every `STEPS[0]`
EVENTS = (  # those of the scenario islanding, closer together
    SwitchEvent(t=0.1, switch="13-152", action="open"),
    SwitchEvent(t=0.5, switch="60-160", action="open"),
)

QUANTITIES = {"f": "Hz", "P": "pu", "Q": "pu", "V": "pu"}


@cache
def step_errors(case: str, method: Method, end: float) -> NDArray[np.float64]:
    """Return the largest errors over all rows and inverters, `STEPS` x `QUANTITIES` (Hz, pu).

    They are of a method in a case of the scenario islanding, T_c 20 ms, until `end` (s).
    """
    _, exact = _reference(case, end)
    return np.array(
        [
            np.abs(_rows(case, h, end, lambda network, config: _plant(network, config, method))[1] - exact).max((0, 1))
            for h in STEPS
        ]
    )


@cache
def _reference(case: str, end: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return _rows(
        case, STEPS[0], end, lambda network, config: reference_plant(network, config.settings, config.T_c, STEPS[0])
    )


def _plant(network: Network, config: PlantConfig, method: Method) -> Plant:
    return Plant(network, replace(config.settings, method=method), config.T_c, config.record_step)


def _rows(
    case: str, h: float, end: float, make: Callable[[Network, PlantConfig], Plant]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (s), and rows x inverters x quantities (Hz, pu) of a run."""
    scenario, feeder = load_scenario("islanding")
    config, agents = configs(scenario, feeder, case)
    settings = replace(config.settings, h=h, events=EVENTS)
    config = replace(config, settings=settings, record_step=STEPS[0], end=end)
    network = Network(feeder)
    rows: list[tuple[float, ...]] = []
    outcome = run_inprocess(config, agents, lambda sent: rows.extend(sent.rows), plant=make(network, config))
    if outcome.broke:
        raise RuntimeError(outcome.broke)
    table = np.array(rows)
    P, V = (np.array([getattr(unit, name) for unit in network.inverters]) for name in ("P_rated", "V_nom"))
    bases = np.column_stack([np.ones(P.size), P, P, V])
    return table[:, 0], table[:, 1:].reshape(len(table), P.size, -1)[:, :, : len(QUANTITIES)] / bases
