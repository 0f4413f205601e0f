import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gridpeers.plant.network import Network, PowerFlow, solve_power_flow
from gridpeers.plant.tables import read_feeder

EXPECTED = Path(__file__).with_name("expected.csv")


@pytest.fixture(scope="module")
def network() -> Network:
    """The standard feeder."""
    return Network(read_feeder("standard123"))


@pytest.fixture(scope="module")
def solved(network: Network) -> PowerFlow:
    """Its solution."""
    return solve_power_flow(network, network.closed0)


def deviations(
    network: Network, solved: PowerFlow, V_column: str, angle_column: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Differences of magnitude (pu) and angle (deg) at all nodes of the table."""
    with EXPECTED.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    nodes = [network.index(row["bus"], row["phase"]) for row in rows]
    V = solved.V[nodes] / network.V_nom[nodes]
    expected_V = np.array([float(row[V_column]) for row in rows])
    expected_angle = np.array([float(row[angle_column]) for row in rows])
    turned_back = V * np.exp(-1j * np.radians(expected_angle))
    return np.abs(np.abs(V) - expected_V), np.abs(np.degrees(np.angle(turned_back)))


def test_voltages_agree_with_the_published_solution(network: Network, solved: PowerFlow) -> None:
    """All 271 published voltages of the IEEE 123-node feeder are met within 0.001 pu."""
    V, angle = deviations(network, solved, "V_published_pu", "angle_published_deg")

    assert len(V) == 271
    assert V.max() < 0.001
    assert angle.max() < 0.06


def test_voltages_agree_with_an_independent_power_flow(network: Network, solved: PowerFlow) -> None:
    """A second, independently written power flow over the same data gives the same 271 voltages to its last digit."""
    V, angle = deviations(network, solved, "V_pu", "angle_deg")

    assert V.max() < 1e-5
    assert angle.max() < 0.001


def test_line_charging_is_part_of_the_published_model(solved: PowerFlow) -> None:
    """Without the lines' shunt capacitance the independent solution is no longer met."""
    bare = Network(read_feeder("standard123"), line_charging=False)

    V, _ = deviations(bare, solve_power_flow(bare, bare.closed0), "V_pu", "angle_deg")

    assert 1e-5 < V.max() < 1e-4


def test_totals_agree_with_the_independent_power_flow(solved: PowerFlow) -> None:
    """Load and losses add up to 3525.3 kW, 1940.3 kvar and 95.59 kW."""
    assert solved.S_loads.real == pytest.approx(3525.3e3, abs=0.05e3)
    assert solved.S_loads.imag == pytest.approx(1940.3e3, abs=0.05e3)
    assert solved.S_losses.real == pytest.approx(95.59e3, abs=0.005e3)


def test_delta_delta_secondary_is_balanced_around_ground(network: Network, solved: PowerFlow) -> None:
    """The unloaded delta-delta transformer passes the line-to-line voltages on, and its secondary's mean is zero."""
    primary, secondary = (np.array([solved.V[network.index(bus, phase)] for phase in "ABC"]) for bus in ("61s", "610"))

    assert abs(secondary.sum()) < 1e-6
    np.testing.assert_allclose(secondary - np.roll(secondary, -1), (primary - np.roll(primary, -1)) * 0.48 / 4.16)
