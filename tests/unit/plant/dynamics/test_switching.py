"""Small circuits around a switching: what the inverters are an instant later."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from gridpeers.plant.dynamics import Circuit, Dynamics, PlantError
from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.inverters import Inverters
from tests.unit.plant.dynamics.circuits import (
    BALANCED,
    GFL_D,
    GFM_D,
    S_B,
    V_B,
    Z_B,
    at_rest,
    circuit,
    inverter,
    loaded,
    lone,
    pair,
)

OMEGA_0 = 2.0 * np.pi * 60.0  # Nominal speed (rad/s)


def constant_power(p: float) -> Circuit:
    """One terminal with a constant-power load of p (pu)."""
    return replace(
        loaded(0.05),
        C=sp.csc_array(np.eye(3)),
        loads=LoadLaw(S=np.full(3, p * S_B / 3.0 + 0j), I0=np.zeros(3, complex)),
        V_branch=(V_B * BALANCED).astype(complex),
    )


def currents(units: Inverters, i: int) -> float:
    """Largest phase current (pu) with the present injections and voltages."""
    I_b = units.S_b[i] / (3.0 * units.V_b[i])
    return float(np.abs(units.J[i] - units.y_f[i] * units.V[i]).max() / I_b)


def test_going_on_with_the_same_network_changes_nothing() -> None:
    """However far an island has turned, its branch voltages are known, and the solution is found where it was."""
    circuit = constant_power(0.4)
    plant = at_rest(circuit, GFM_D, h=0.002)
    plant.inverters.set_points[0, 0] += 0.2
    plant.run(3000)
    before, noted = plant.inverters.V.copy(), plant.network.V_branch.copy()

    plant.connect(circuit)

    one_step = 0.2 * 0.01 * OMEGA_0 * plant.h
    assert abs(np.angle(before[0, 0])) > 100 * one_step
    np.testing.assert_allclose(noted, before[0], rtol=1.1 * one_step)  # the branches are at the terminal
    np.testing.assert_allclose(plant.inverters.V, before, rtol=1.1 * one_step)
    np.testing.assert_allclose(np.abs(plant.inverters.V), np.abs(before), rtol=1e-9)


def test_a_gfm_alone_starts_a_de_energised_island_at_its_set_point() -> None:
    """Taken off, it leaves 0 V behind; put back where there is no voltage, it holds nominal voltage at angle 0."""
    plant = lone(GFM_D, 0.3)
    plant.run(100)
    plant.switch_inverters([0], False)
    off = plant.inverters.V.copy()
    plant.switch_inverters([0], True)

    units = plant.inverters
    assert not off.any()
    assert units.set_points[0].tolist() == [0.0, 1.0, 0.0]
    assert (units.state_of(0)["E"], units.state_of(0)["theta"]) == pytest.approx((1.0, 0.0))
    assert plant.readings()[0, 1] == pytest.approx(0.3 * S_B, rel=0.05)


def test_a_gfm_comes_back_in_step() -> None:
    """Put back on a live island, a GFM carries no current, turns as the island turns, and would rest there."""
    plant = pair(GFM_D, GFM_D, 0.4)
    plant.inverters.set_points[:, 0] = 0.3, 0.1
    plant.run(200)
    plant.switch_inverters([1], False)
    plant.run(500)
    plant.switch_inverters([1], True)

    units = plant.inverters
    w = float(units.state_of(0)["w"])
    assert abs(w) > 0.1
    assert units.state_of(1)["w"] == w
    assert units.set_points[1, 0] == pytest.approx(w / (0.01 * OMEGA_0))
    assert currents(units, 1) < 1e-9


def weak_line(h: float = 0.002) -> Dynamics:
    """Two GFL, one after the other on a line of twice j0.25 pu, with uneven loads beside them; phase C has none."""
    y, loads = 1.0 / ((0.02 + 0.25j) * Z_B), np.array([[0.4, 0.2, 0.0], [0.1, 0.3, 0.0]]) / Z_B
    Y = np.zeros((9, 9), complex)
    for a, b in [(phase + 3 * k, phase + 3 * (k + 1)) for phase in range(3) for k in range(2)]:
        Y[[a, b], [a, b]] += y
        Y[[a, b], [b, a]] -= y
    Y[range(3, 9), range(3, 9)] += loads.ravel()
    network = circuit(Y, [[3, 4, 5], [6, 7, 8]], source=V_B * BALANCED)
    dynamics = Dynamics(network, (inverter(GFL_D), inverter(GFL_D)), h)
    dynamics.start(np.full(2, 0.2), np.zeros(2))
    return dynamics


def test_several_gfl_come_back_at_no_current_on_a_weak_line() -> None:
    """The voltage at open terminals is that with none of them: no phase carries current, and both stay at rest."""
    plant = weak_line()
    assert plant.inverters.y_f.all()  # behind filters, which would load the line
    plant.run(1000)
    plant.switch_inverters((0, 1), False)
    plant.run(10)
    open_terminals = plant.inverters.V.copy()
    plant.switch_inverters((0, 1), True)

    units = plant.inverters
    np.testing.assert_allclose(units.V, open_terminals, rtol=1e-9)
    assert max(currents(units, 0), currents(units, 1)) < 1e-9
    assert units.set_points[:, 0] == pytest.approx(0.0)
    assert np.abs(plant.run(1000)[:, :, 1]).max() < 1e-6 * S_B


def test_a_gfl_in_an_island_that_starts_again_begins_at_no_current() -> None:
    """A GFM that brings the voltage back finds no load in the filter of a GFL that was connected all the time."""
    network = pair(GFM_D, GFM_D, 0.4).network.circuit
    plant = Dynamics(network, (inverter(GFM_D), inverter(GFL_D)), 0.002)
    plant.start(np.array([0.4, 0.0]), np.zeros(2))
    plant.switch_inverters([0], False)
    assert plant.inverters.connected.tolist() == [False, True]
    plant.switch_inverters([0], True)

    assert currents(plant.inverters, 1) < 1e-9


def test_switching_what_is_so_already_changes_nothing() -> None:
    """Connecting a connected inverter leaves its set-points and its injections alone."""
    plant = lone(GFM_D, 0.3)
    before = plant.inverters.set_points.copy(), plant.inverters.J.copy()

    plant.switch_inverters([0], True)

    assert np.array_equal(plant.inverters.set_points, before[0])
    assert np.array_equal(plant.inverters.J, before[1])


def test_an_island_without_solution_is_de_energised_until_it_can_be_fed() -> None:
    """A load of twenty times the rating trips the inverter; with 0.4 and 0.05 pu it starts the island again."""
    plant: Dynamics = lone(GFM_D, 0.3)
    dead_weight = constant_power(20.0)
    plant.network.V_branch = dead_weight.V_branch.copy()

    plant.connect(dead_weight)

    (trip,) = plant.take_trips()
    assert (trip.inverters, trip.substation, plant.take_trips()) == ((0,), False, [])
    assert not plant.inverters.connected.any()
    assert plant.run(5)[:, 0, :4].tolist() == [[0.0] * 4] * 5  # a dead terminal has no frequency

    plant.connect(constant_power(0.4))
    plant.switch_inverters([0], True)

    assert plant.run(500)[-1, 0, 1] == pytest.approx(0.45 * S_B, rel=1e-4)


def test_a_tangent_that_leads_nowhere_is_renewed_in_the_middle_of_a_step() -> None:
    """With the tangent of far too low a voltage the run takes the same course: no step twice, and none left out."""
    good, bad = at_rest(constant_power(0.9), GFM_D, h=0.002), at_rest(constant_power(0.9), GFM_D, h=0.002)
    renewed = 0
    for plant in (good, bad):
        plant.inverters.set_points[0, 0] += 0.2
    want = good.run(50)
    got = []
    for _ in range(10):
        network = bad.network
        x = network.x.copy()
        network.net = network.reduction.linearise(
            0.35 * network.V_branch, network.circuit.source_voltage, bad.inverters.theta()
        )
        network.x = x
        spoilt = network.net
        got.append(bad.run(5))
        renewed += network.net is not spoilt

    assert renewed == 10
    assert bad.take_trips() == []
    np.testing.assert_allclose(np.concatenate(got), want, rtol=1e-8, atol=1e-6)


@pytest.mark.parametrize("column", [0, 1])
def test_a_model_that_gives_no_number_ends_the_run(column: int) -> None:
    """It is an error of the model, not of its island; here a set-point leads to it."""
    plant = pair(GFM_D, GFM_D, 0.4)
    plant.inverters.set_points[1, column] = np.nan

    with pytest.raises(PlantError, match="GFM: the inverter model GfmDroop gives a current or a state that is no f"):
        plant.run(20)
