"""An island within the networked microgrid: neighbours that stand elsewhere must not be listened to."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from agents.agent import Agent
from plant.config import SwitchEvent
from scenarios.drivers.inprocess import run_inprocess
from scenarios.spec import load_scenario
from scenarios.spec.configs import configs


def last_row() -> tuple[tuple[float, ...], list[float]]:
    """Last row of case IV in which the microgrid falls into three islands at 2 s; and the ratings (W)."""
    scenario, feeder = load_scenario("islanding")
    plant, agents = configs(scenario, feeder, "IV")
    events = (
        SwitchEvent(t=0.5, switch="13-152", action="open"),
        SwitchEvent(t=2.0, switch="sw1_2", action="open"),
        SwitchEvent(t=2.0, switch="sw2_3", action="open"),
    )
    settings = replace(plant.settings, events=events, load_set="main")
    rows: list[tuple[float, ...]] = []
    outcome = run_inprocess(
        replace(plant, settings=settings, end=5.0), agents, lambda telemetry: rows.extend(telemetry.rows)
    )
    assert outcome.broke == ""
    return rows[-1], [agent.P_rated for agent in agents]


def test_each_island_has_60_hz_and_shares_among_its_own() -> None:
    """Full graph over three islands: a state names its island, and who stands in another leaves it out."""
    row, rated = last_row()
    shares = [P / s for P, s in zip(row[2::6], rated, strict=True)]

    assert [f - 60.0 for f in row[1::6]] == pytest.approx([0.0] * 9, abs=0.002)
    for island in (shares[:3], shares[3:6], shares[6:]):
        assert max(island) - min(island) < 0.005
    assert shares[0] - shares[3] > 0.1


def test_without_that_rule_a_frequency_error_would_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    """So the rule is needed: the islands would agree on set-points that fit none of them."""
    monkeypatch.setattr(Agent, "shares_island", lambda self, name: name in self._heard)
    row, _ = last_row()

    assert max(abs(f - 60.0) for f in row[1::6]) > 0.02
