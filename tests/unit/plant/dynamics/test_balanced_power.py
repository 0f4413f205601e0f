"""The GFL of balanced power: a PLL and a current reference for each phase (`inverter-models.md` section 4)."""

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.equipment.inverter_parameters import GflParameters
from tests.unit.plant.dynamics.circuits import BALANCED, GFL_D, S_B, V_B, circuit, inverter, move_source

UNEQUAL = V_B * BALANCED * np.array([1.0, 0.9, 1.05]) * np.exp(1j * np.radians([0.0, 4.0, -3.0]))
"""Unequal phase voltages, B and C off their angles (V)."""


def at_unequal_voltages(parameters: GflParameters) -> Dynamics:
    """A GFL of 0.6 + j0.2 pu at a stiff bus of unequal phases, at rest."""
    bus = circuit(np.zeros((3, 3), complex), [[0, 1, 2]], source=UNEQUAL)
    dynamics = Dynamics(bus, (inverter(parameters),), 0.002)
    dynamics.start(np.array([0.6]), np.array([0.2]))
    return dynamics


@pytest.mark.parametrize("model", ["voltage_source", "current_source"])
def test_phases_of_unequal_voltage_deliver_equal_powers_at_rest(model: str) -> None:
    """Each phase gives a third of 0.6 + j0.2 pu from the start on, and nothing moves."""
    dynamics = at_unequal_voltages(replace(GFL_D, mode="balanced_power", model=model))
    dynamics.inverters.set_points[0, 2] = 0.2

    dynamics.run(500)
    powers = dynamics.inverters.V[0] * np.conj(dynamics.inverters.I[0]) / (S_B / 3.0)

    assert powers == pytest.approx(np.full(3, 0.6 + 0.2j), abs=1e-9)


def test_in_positive_sequence_the_currents_are_equal_instead() -> None:
    """The other mode drives the same current in all phases at the same voltages."""
    dynamics = at_unequal_voltages(GFL_D)

    dynamics.run(500)
    currents = np.abs(dynamics.inverters.I[0])

    assert currents == pytest.approx(np.full(3, currents[0]), rel=1e-9)


def test_a_power_step_reaches_every_phase_alike() -> None:
    """After a step of P the phases have a third of it each, whatever their voltages."""
    dynamics = at_unequal_voltages(replace(GFL_D, mode="balanced_power"))
    dynamics.inverters.hold(0, 0.9, 1.0)

    dynamics.run(2000)
    powers = dynamics.inverters.V[0] * np.conj(dynamics.inverters.I[0]) / (S_B / 3.0)

    assert powers.real == pytest.approx(np.full(3, 0.9), abs=1e-6)


def test_the_frequency_is_the_mean_of_the_three_plls() -> None:
    """A jump of phase B alone moves the reading by a third of what that PLL sees."""
    dynamics = at_unequal_voltages(replace(GFL_D, mode="balanced_power"))
    moved = UNEQUAL * np.exp(1j * np.array([0.0, 0.1, 0.0]))
    move_source(dynamics, moved)

    out = dynamics.run(1)
    k_p, k_i, u_B = 50.0, 900.0, 0.9
    first = u_B * np.sin(0.1)
    theta = 0.002 * (k_p + 0.002 * k_i) * first  # the predictor's angle; the corrector sees what remains
    second = u_B * np.sin(0.1 - theta)
    w = k_p * second + 0.001 * k_i * (first + second)

    assert out[0, 0, 0] - 60.0 == pytest.approx(w / 3.0 / (2.0 * np.pi), rel=1e-6)
