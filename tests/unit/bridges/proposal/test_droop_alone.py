"""A plant that does not come to rest on droop alone is found before a study is built on it."""

from __future__ import annotations

import pytest

import gridpeers as gp
from gridpeers.bridges.proposal.proposed_project import unsteady


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

    assert bool(said) == bool(found)
    assert not said or found in said.text


def test_a_load_that_an_event_raises_counts_too() -> None:
    """The plant is not found at rest before the load that it cannot feed has come."""
    heavy = {str(bus): {"factor": 10.0} for bus in (48, 65, 76)}
    islanding = gp.load("islanding")
    events = [*islanding.tables["event"], {"label": "heavy", "t_s": 6.0, "load": heavy}]
    scenario = islanding.replace({"event": events, "paper": ""})

    said = unsteady(scenario.spec, scenario.feeder, "I")

    assert said
    assert "tripped" in said.text
