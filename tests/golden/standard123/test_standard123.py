import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.tables import read_feeder

EXPECTED = Path(__file__).with_name("expected.csv")


@pytest.fixture(scope="module")
def network() -> Network:
    return Network(read_feeder("standard123"))


@pytest.fixture(scope="module")
def V(network: Network) -> NDArray[np.complex128]:
    return solve_power_flow(network, network.closed0)


def deviations(
    network: Network, V: NDArray[np.complex128], V_column: str, angle_column: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Differences of magnitude (pu) and angle (deg) at all nodes of the table."""
    with EXPECTED.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    nodes = [network.index(row["bus"], row["phase"]) for row in rows]
    V = V[nodes] / network.V_nom[nodes]
    expected_V = np.array([float(row[V_column]) for row in rows])
    expected_angle = np.array([float(row[angle_column]) for row in rows])
    turned_back = V * np.exp(-1j * np.radians(expected_angle))
    return np.abs(np.abs(V) - expected_V), np.abs(np.degrees(np.angle(turned_back)))


def test_voltages_agree_with_the_published_solution(network: Network, V: NDArray[np.complex128]) -> None:
    """All 271 published voltages of the IEEE 123-node feeder are met within 0.001 pu."""
    off, angle = deviations(network, V, "V_published_pu", "angle_published_deg")

    assert len(off) == 271
    assert off.max() < 0.001
    assert angle.max() < 0.06


def test_voltages_agree_with_an_independent_power_flow(network: Network, V: NDArray[np.complex128]) -> None:
    """A second, independently written power flow over the same data gives the same 271 voltages to its last digit."""
    off, angle = deviations(network, V, "V_pu", "angle_deg")

    assert off.max() < 1e-5
    assert angle.max() < 0.001


def test_line_charging_is_part_of_the_published_model() -> None:
    """Without the lines' shunt capacitance the independent solution is no longer met."""
    bare = Network(read_feeder("standard123"), line_charging=False)

    off, _ = deviations(bare, solve_power_flow(bare, bare.closed0), "V_pu", "angle_deg")

    assert 1e-5 < off.max() < 1e-4


def test_totals_agree_with_the_independent_power_flow(network: Network, V: NDArray[np.complex128]) -> None:
    """Load and losses add up to 3525.3 kW, 1940.3 kvar and 95.59 kW."""
    S_loads = network.loads().powers(V).sum() + V @ np.conj(network.Y_loads @ V)

    assert S_loads.real == pytest.approx(3525.3e3, abs=0.05e3)
    assert S_loads.imag == pytest.approx(1940.3e3, abs=0.05e3)
    assert (V @ np.conj(network.Y_branches @ V)).real == pytest.approx(95.59e3, abs=0.005e3)
