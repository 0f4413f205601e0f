"""A plant that does not come to rest on droop alone is found before a study is built on it."""

from __future__ import annotations

import pytest

import gridpeers as gp
from scenarios.proposal.droop_alone import unsteady


@pytest.mark.parametrize(
    ("gfl", "found"),
    [
        ({}, ""),
        ({"plant.gfl.T_vf_s": 0.01, "plant.gfl.T_qf_s": 0.02}, "do not calm down"),
        ({"plant.gfl.F_current": 0.9}, "tripped"),
    ],
)
def test_an_oscillation_and_a_collapse_are_found(gfl: dict[str, float], found: str) -> None:
    """The paper's islanding comes to rest; it swings with short lags of volt-var, and trips with F_current 0.9."""
    scenario = gp.load("islanding").replace(gfl)

    said = unsteady(scenario.spec, scenario.feeder, "I")

    assert found in said
    assert bool(said) == bool(found)
