"""The solution of one island's load branches, against closed forms and the plain power flow."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from msgspec.structs import replace

from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.island_newton import DenseIsland, solve_island
from gridpeers.plant.dynamics.kernel.compiled import Complex
from gridpeers.plant.dynamics.reduction import DenseReduction, SparseIsland, SparseReduction
from gridpeers.plant.feeder.circuits import Circuits
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.tables import read_feeder

X, E = 0.5, 240.0


def voltage_of(P: float, E_0: complex, guess: complex) -> Complex | None:
    """Voltage (V) of one load of constant power P (W) behind a reactance X (ohm) and a source E_0 (V)."""
    load = LoadLaw(S=np.array([P + 0j]), I0=np.zeros(1, complex))
    island = DenseIsland(np.array([[1j * X]]), load, np.array([E + 0j]), np.array([E_0]))
    return solve_island(island, np.array([guess]))


@pytest.mark.parametrize("part", [0.1, 0.9, 0.999])
@pytest.mark.parametrize("guess", [1.0, 0.3, 0.01])
def test_a_load_behind_a_reactance_has_the_textbook_voltage(part: float, guess: float) -> None:
    """|V|^2 = E^2/2 + sqrt(E^4/4 - X^2 P^2), the higher of both solutions, also from a guess near the lower one."""
    P = part * E**2 / (2.0 * X)

    V = voltage_of(P, E, guess * E)

    assert V is not None
    assert abs(V[0]) ** 2 == pytest.approx(E**2 / 2.0 + np.sqrt(E**4 / 4.0 - (X * P) ** 2), rel=1e-9)


@pytest.mark.parametrize("part", [1.001, 2.0, 100.0])
def test_more_than_the_largest_load_has_no_solution(part: float) -> None:
    """Beyond E^2 / 2X nothing is found, rather than something that does not solve."""
    assert voltage_of(part * E**2 / (2.0 * X), E, E) is None


@pytest.mark.parametrize("B", [1e3, 1e5, 1e7])
def test_a_load_behind_next_to_no_impedance_has_the_textbook_voltage(B: float) -> None:
    """A susceptance of 1e7 S before the load, as of a switch, leaves rounding in every step: that is a solution."""
    P, X_all, y = 0.7 * E**2 / (2.0 * X), X + 1.0 / B, -1j * B
    load = LoadLaw(S=np.array([P + 0j]), I0=np.zeros(1, complex))
    Y = sp.csc_array(np.array([[y + 1.0 / (1j * X), -y], [-y, y]]))
    right = np.array([E / (1j * X), 0.0])

    V = solve_island(SparseIsland(Y, sp.csc_array([[0.0], [1.0]]), load, np.zeros(1, complex), right), right)

    assert V is not None
    assert abs(V[1]) ** 2 == pytest.approx(E**2 / 2.0 + np.sqrt(E**4 / 4.0 - (X_all * P) ** 2), rel=1e-7)


def test_what_is_not_finite_has_no_solution() -> None:
    """Injections that are not numbers give no voltages."""
    assert voltage_of(1e3, complex("nan"), E) is None


@pytest.mark.parametrize("reduction", [DenseReduction, SparseReduction])
@pytest.mark.parametrize("scale", [1.0, 1.3, 1.6])
def test_the_feeder_has_the_voltages_of_the_plain_power_flow(
    scale: float, reduction: type[DenseReduction | SparseReduction]
) -> None:
    """From nominal voltages, and from wrong ones, the same as the fixed point of `solve_power_flow`: two methods."""
    feeder = read_feeder("microgrid123")
    loads = tuple(replace(load, S=tuple(scale * S for S in load.S)) for load in feeder.loads)
    network = Network(replace(feeder, loads=loads))
    want = solve_power_flow(network, network.closed0).V
    circuit = Circuits(network).of(network.closed0)
    n = len(network.inverters)
    state = reduction(circuit, np.zeros(n, complex), np.zeros(n, bool), np.zeros(n, bool))

    for factor in (1.0, 0.6 + 0.3j):
        J = np.zeros((n, 3), complex)
        V_b, failed = state.solve_islands(J, circuit.source_voltage, factor * circuit.V_branch)
        assert failed == ()
        np.testing.assert_allclose(V_b, circuit.C.T @ want, rtol=1e-7)
