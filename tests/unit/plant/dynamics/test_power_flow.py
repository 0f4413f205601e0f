"""The fixed point between the network and inverters of constant power."""

from __future__ import annotations

import numpy as np
import pytest

from gridpeers.plant.dynamics.circuit import PlantError
from gridpeers.plant.dynamics.inverters import Inverters
from gridpeers.plant.dynamics.power_flow_at_rest import PowerFlow
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, V_B, Z_B, circuit, inverter

REACTANCE = 1.0
"""Reactance (pu) between the inverter and a stiff bus of 1 pu; it carries 0.5 pu at most without reactive power."""


def exported(P: float) -> complex:
    """Return the voltage (pu) of an inverter that delivers P (pu) over the reactance; phase A."""
    y = 1.0 / (1j * REACTANCE * Z_B)
    Y = np.kron(np.array([[y, -y], [-y, y]]), np.eye(3))
    network = circuit(Y, [[3, 4, 5]], source=V_B * BALANCED)
    flow = PowerFlow(network, Inverters((inverter(GFL_D),), [True]), np.zeros(1, bool))
    V = flow.solve(np.zeros((1, 3), complex), np.array([P]), np.zeros(1), np.zeros(1, bool))[1]
    return complex(V[0, 0] / V_B)


def test_a_slow_fixed_point_is_followed_to_its_end() -> None:
    """At 0.4997 pu of 0.5 each round leaves 0.966 of the error: V sin(delta) is P, and V is cos(delta)."""
    P = 0.4997
    delta = 0.5 * np.arcsin(2.0 * P)

    assert exported(P) == pytest.approx(np.cos(delta) * np.exp(1j * delta), abs=1e-9)


def test_a_power_beyond_what_the_network_carries_is_refused() -> None:
    """0.51 pu of 0.5: the injections never settle."""
    with pytest.raises(PlantError, match="deliver more than the network can carry"):
        exported(0.51)
