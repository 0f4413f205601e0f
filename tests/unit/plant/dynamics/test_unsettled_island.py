"""Which of several islands fails, where the inner loop solves all of them at once."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from msgspec.structs import replace

from gridpeers.plant.dynamics import Circuit, Dynamics, reduction
from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.live_network import unsettled_island
from tests.unit.plant.dynamics.circuits import BALANCED, GFM_D, S_B, V_B, Z_B, inverter

ISLANDS = 3


def lone_islands(I_max: float) -> Dynamics:
    """Three GFM, each alone with constant power of 0.3 pu, at rest."""
    n = 3 * ISLANDS
    circuit = Circuit(
        Y=sp.csc_array(0.01 * np.eye(n) / Z_B),
        sources=np.arange(0),
        source_voltage=np.zeros(0, complex),
        terminals=np.arange(n).reshape(ISLANDS, 3),
        C=sp.csc_array(np.eye(n)),
        loads=LoadLaw(S=np.full(n, 0.3 * S_B / 3.0 + 0j), I0=np.zeros(n, complex)),
        V_branch=V_B * np.tile(BALANCED, ISLANDS),
    )
    dynamics = Dynamics(circuit, (inverter(replace(GFM_D, I_max=I_max)),) * ISLANDS, 0.002)
    dynamics.start(np.full(ISLANDS, 0.3), np.zeros(ISLANDS))
    dynamics.run(5)
    return dynamics


@pytest.mark.parametrize("most_dense", [0, 1000], ids=["sparse", "dense"])
@pytest.mark.parametrize("island", range(ISLANDS))
@pytest.mark.parametrize(("load", "I_max"), [(8.0, 1000.0), (2.0, 1.2)], ids=["collapse", "limit"])
def test_the_island_with_more_load_than_it_can_carry_is_found(
    monkeypatch: pytest.MonkeyPatch, most_dense: int, island: int, load: float, I_max: float
) -> None:
    """Among three live islands it is the one whose load has no solution, by its voltages or by its current limit."""
    monkeypatch.setattr(reduction, "MOST_DENSE", most_dense)
    dynamics = lone_islands(I_max)
    net, here = dynamics.network.net, dynamics.network.net.branch_island == island
    assert here.any()
    net.S[here] *= load / 0.3

    assert unsettled_island(net, dynamics.arrays(), dynamics.network.x, 1e-11 * V_B) == island
