"""The operating point from voltage set-points, by either way of finding the reactive powers."""

from __future__ import annotations

import numpy as np
import pytest

from gridpeers.plant.dynamics import power_flow_at_rest
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import read_feeder


def start() -> Plant:
    """Return the microgrid feeder at rest."""
    return Plant(Network(read_feeder("microgrid123")), PlantSettings(), 0.02, 0.02)


def reactive_powers(plant: Plant) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return what the inverters deliver (pu)."""
    rated = np.array([unit.P_rated for unit in plant.network.inverters])
    Q = np.array([reading.Q for reading in plant.measure().values()]) / rated
    assert np.abs(Q).max() > 1e-3
    return Q


def test_many_inverters_start_where_few_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Newton-Krylov, which many inverters need, gives the reactive powers that a full Jacobian gives, to 1e-10 pu."""
    few = start()
    methods = []

    def noted(*arguments: object, **named: object) -> object:
        methods.append(named["method"])
        return root(*arguments, **named)

    root = power_flow_at_rest.root
    monkeypatch.setattr(power_flow_at_rest, "root", noted)
    monkeypatch.setattr(power_flow_at_rest, "MOST_BY_DIFFERENCES", 0)
    many = start()

    assert methods == ["krylov"]
    assert reactive_powers(many) == pytest.approx(reactive_powers(few), abs=1e-10)


def test_many_inverters_that_newton_krylov_does_not_solve_start_as_few_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where Newton-Krylov does not converge, the full Jacobian decides."""
    few = start()
    monkeypatch.setattr(power_flow_at_rest, "MOST_BY_DIFFERENCES", 0)
    monkeypatch.setattr(power_flow_at_rest, "KRYLOV", power_flow_at_rest.KRYLOV | {"maxiter": 1})

    assert reactive_powers(start()) == pytest.approx(reactive_powers(few), abs=1e-10)
