"""The power flow of an island from a row of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from gridpeers.plant.equipment import Bus, InverterRow, Tables
from gridpeers.plant.equipment.imported_equipment import LinearElement, LoadPart
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.scenarios.checks.balance_check import IslandBalance, IslandPowerFlow, NetworkState
from tests.unit.bridges.proposal.test_feeder_proposal import series

V_NOM = 2400.0
LOADS = {"A": 160e3 + 40e3j, "B": 80e3 + 20e3j, "C": 120e3 + 30e3j}
"""Constant powers (VA) by phase: unequal, so that the mean of the phases is no positive sequence."""


def island(follower: float) -> Tables:
    """A leader of 200 kVA, and over a line of one siemens a follower (W), the loads and a capacitor."""
    capacitor = LinearElement(
        name="capacitor.b",
        nodes=tuple(("b", phase) for phase in "ABC"),
        Y=tuple(tuple(0.01j if i == j else 0j for j in range(3)) for i in range(3)),
    )
    rows = [("inv1", "GFM", "a", 200e3), ("inv2", "GFL", "b", follower)]
    return Tables(
        name="island",
        load_set="main",
        source=None,
        buses=tuple(Bus(name=name, phases="ABC", V_nom=V_NOM, x=0.0, y=0.0) for name in "ab"),
        elements=(series("line.ab", "a", "b", "ABC"), capacitor),
        load_parts=tuple(
            LoadPart(name="load.b", bus="b", ends=(phase, ""), S=S, V_nom=V_NOM, exponents=(0.0, 0.0))
            for phase, S in LOADS.items()
        ),
        inverters=tuple(
            InverterRow(name=name, kind=kind, bus=bus, microgrid="MG1", P_rated=P, V_nom=V_NOM, m_p=0.01, m_q=0.05)
            for name, kind, bus, P in rows
        ),
    )


def balance_at_start(feeder: Tables, settings: PlantSettings) -> IslandBalance:
    """The balance of a plant's first row."""
    readings = Plant(Network(feeder), settings, 0.02, 0.02).measure()
    P, Q, V = np.array([(reading.P, reading.Q, reading.V) for reading in readings.values()]).T
    present = np.ones(len(readings), bool)
    [balance] = IslandPowerFlow(feeder, tuple(readings), settings).balances(NetworkState(frozenset()), P, Q, V, present)
    return balance


@pytest.mark.parametrize("follower", [1e6, 3e6])
def test_the_power_flow_of_a_row_has_the_powers_of_the_row(follower: float) -> None:
    """A small leader among followers of constant power, too: there the voltage makes many times a step of the EMF."""
    balance = balance_at_start(island(follower), PlantSettings(P_set0=360e3 / (200e3 + follower)))

    assert balance.taken == pytest.approx(balance.generated, rel=1e-5)


def test_the_power_flow_of_a_row_has_its_powers_beside_a_neutral_that_floats(tmp_path: Path) -> None:
    """Loads alone hold the neutral, at 100 V to earth: their powers are those at voltages between phase and neutral."""
    from tests.unit.plant.feeder.test_neutrals import KINDS, imported, with_followers

    feeder, _ = imported(tmp_path, KINDS["earthed at the transformer"])
    feeder = with_followers(feeder.add_inverter("bat", "b1", "GFM", 6e4, neutral="earth"))
    switches = tuple(replace(switch, closed=False) for switch in feeder.switches)

    balance = balance_at_start(replace(feeder, switches=switches), PlantSettings(P_set0=0.2))

    assert balance.taken == pytest.approx(balance.generated, rel=1e-5)
