import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.feeder.plant import installed_inverters
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import read_feeder

HERE = Path(__file__).parent
Z_GFM = 0.0025 + 0.05j  # Coupling impedance of the GFM in the study (pu of the own rating)


def rows(file: str) -> list[dict[str, str]]:
    with (HERE / file).open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def network() -> Network:
    return Network(read_feeder("microgrid123", "main"))


@pytest.fixture(scope="module")
def V(network: Network) -> NDArray[np.complex128]:
    """Its voltages (V) where the inverters feed: the plant's start at their powers."""
    settings = PlantSettings(gfm=GfmDroop(R_f=Z_GFM.real, X_f=Z_GFM.imag))
    dynamics = Dynamics(
        circuit_of(network, network.closed0, network.loads()), installed_inverters(network, settings), 0.002
    )
    of = {row["name"]: row for row in rows("inverters.csv")}
    P, Q = (np.array([float(of[unit.name][key]) for unit in network.inverters]) for key in ("P_pu", "Q_pu"))
    dynamics.start(P, Q)
    return network.merge(network.closed0).expand(dynamics.voltages())


def test_voltages_agree_with_an_independent_power_flow(network: Network, V: NDArray[np.complex128]) -> None:
    """All 283 voltages of the grid-connected microgrids, inverters feeding, are met to the last digit given."""
    expected = rows("expected.csv")
    V = V[[network.index(row["bus"], row["phase"]) for row in expected]]
    V_nom = np.array([network.V_nom[network.index(row["bus"], row["phase"])] for row in expected])
    angle = np.radians([float(row["angle_deg"]) for row in expected])

    assert len(expected) == 283
    assert np.abs(np.abs(V) / V_nom - [float(row["V_pu"]) for row in expected]).max() < 1e-5
    assert np.abs(np.degrees(np.angle(V * np.exp(-1j * angle)))).max() < 0.001


def test_power_balance(network: Network, V: NDArray[np.complex128]) -> None:
    """Load, losses and capacitors have the totals of the independent power flow."""
    loads = network.loads().powers(V).sum() + V @ np.conj(network.Y_loads @ V)
    losses, capacitors = (V @ np.conj(Y @ V) for Y in (network.Y_branches, network.Y_capacitors))

    assert [loads, losses, capacitors] == pytest.approx([4173.4e3 + 2268.4e3j, 28.5e3 + 51.5e3j, -743.0e3j], abs=0.06e3)
