"""The power flow of an island from a row of a run."""

from __future__ import annotations

import numpy as np
import pytest

from plant.equipment import Bus, Feeder, InverterRow
from plant.equipment.imported_equipment import LinearElement, LoadPart
from plant.feeder import Plant
from plant.network import Network
from plant.plant_config import PlantSettings
from scenarios.checks.physics.island_power_flow import IslandPowerFlow, NetworkState
from tests.unit.scenarios.proposal.test_feeder_proposal import series

V_NOM = 2400.0
LOADS = {"A": 160e3 + 40e3j, "B": 80e3 + 20e3j, "C": 120e3 + 30e3j}
"""Constant powers (VA) by phase: unequal, so that the mean of the phases is no positive sequence."""


def island(follower: float) -> Feeder:
    """A leader of 200 kVA, and over a line of one siemens a follower (W), the loads and a capacitor."""
    capacitor = LinearElement(
        name="capacitor.b",
        nodes=tuple(("b", phase) for phase in "ABC"),
        Y=tuple(tuple(0.01j if i == j else 0j for j in range(3)) for i in range(3)),
    )
    rows = [("inv1", "GFM", "a", 200e3), ("inv2", "GFL", "b", follower)]
    return Feeder(
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


@pytest.mark.parametrize("follower", [1e6, 3e6])
def test_the_power_flow_of_a_row_has_the_powers_of_the_row(follower: float) -> None:
    """A small leader among followers of constant power, too: there the voltage makes many times a step of the EMF."""
    feeder = island(follower)
    settings = PlantSettings(P_set0=360e3 / (200e3 + follower))
    readings = Plant(Network(feeder), settings, 0.02, 0.02).measure().values()

    [balance] = IslandPowerFlow(feeder, ("inv1", "inv2"), settings).balances(
        NetworkState(frozenset()),
        np.array([reading.P for reading in readings]),
        np.array([reading.Q for reading in readings]),
        np.array([reading.V for reading in readings]),
        np.ones(2, bool),
    )

    assert balance.taken == pytest.approx(balance.generated, rel=1e-5)
