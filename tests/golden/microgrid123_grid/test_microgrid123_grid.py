import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gridpeers.plant.network import Network, PowerFlow, solve_power_flow
from gridpeers.plant.tables import read_feeder

HERE = Path(__file__).parent
Z_GFM = 0.0025 + 0.05j
"""Coupling impedance of the GFM in the study (pu of the own rating)."""
A = np.exp(2j * np.pi / 3.0)


def rows(file: str) -> list[dict[str, str]]:
    """Rows of one of the case's tables."""
    with (HERE / file).open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def network() -> Network:
    """The networked microgrids."""
    return Network(read_feeder("microgrid123", "main"))


@pytest.fixture(scope="module")
def solved(network: Network) -> PowerFlow:
    """Its solution with the inverters feeding."""
    shunt = np.zeros(len(network.nodes), dtype=np.complex128)
    units = []
    for inverter, row in zip(network.inverters, rows("inverters.csv"), strict=True):
        assert inverter.name == row["name"]
        terminals = [network.index(inverter.bus, phase) for phase in "ABC"]
        Z_base = 3.0 * inverter.V_nom**2 / inverter.P_rated
        y = 1.0 / (Z_GFM * Z_base) if inverter.kind == "GFM" else 0j
        shunt[terminals] = y
        units.append((terminals, y, inverter.P_rated * complex(float(row["P_pu"]), float(row["Q_pu"]))))

    def injection(V: NDArray[np.complex128]) -> NDArray[np.complex128]:
        # Balanced Norton current that makes the terminal power S: inverter-models.md section 7, steps 1 and 2.
        J = np.zeros(len(V), dtype=np.complex128)
        for terminals, y, S in units:
            v = V[terminals]
            V1 = (v[0] + A * v[1] + A**2 * v[2]) / 3.0
            J[terminals] = np.conj((S + np.sum(v * np.conj(y * v))) / (3.0 * V1)) * np.array([1.0, A**2, A])
        return J

    return solve_power_flow(network, network.closed0, shunt=shunt, injection=injection)


def test_voltages_agree_with_an_independent_power_flow(network: Network, solved: PowerFlow) -> None:
    """All 283 voltages of the grid-connected microgrids, inverters feeding, are met to the last digit given."""
    expected = rows("expected.csv")
    V = np.array([solved.V[network.index(row["bus"], row["phase"])] for row in expected])
    V_nom = np.array([network.V_nom[network.index(row["bus"], row["phase"])] for row in expected])
    angle = np.radians([float(row["angle_deg"]) for row in expected])

    assert len(expected) == 283
    assert np.abs(np.abs(V) / V_nom - [float(row["V_pu"]) for row in expected]).max() < 1e-5
    assert np.abs(np.degrees(np.angle(V * np.exp(-1j * angle)))).max() < 0.001


def test_positive_sequence_at_the_inverters(network: Network, solved: PowerFlow) -> None:
    """The inverters' terminals have the positive-sequence voltages of the independent power flow."""
    for inverter, row in zip(network.inverters, rows("inverters.csv"), strict=True):
        v = [solved.V[network.index(inverter.bus, phase)] for phase in "ABC"]
        V1 = abs(v[0] + A * v[1] + A**2 * v[2]) / 3.0 / inverter.V_nom

        assert pytest.approx(float(row["V_positive_sequence_pu"]), abs=6e-5) == V1


def test_power_balance(solved: PowerFlow) -> None:
    """Substation, load, losses and capacitors have the totals of the independent power flow."""
    tolerance = 0.06e3

    assert solved.S_source == pytest.approx(1678.6e3 + 1120.7e3j, abs=tolerance)
    assert solved.S_loads == pytest.approx(4173.4e3 + 2268.4e3j, abs=tolerance)
    assert solved.S_losses == pytest.approx(28.5e3 + 51.5e3j, abs=tolerance)
    assert solved.S_capacitors == pytest.approx(-743.0e3j, abs=tolerance)
