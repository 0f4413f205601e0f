"""Data of the feeder, and available power, that a scenario changes: what can be and what cannot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings, PowerLimit
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs, limits_of
from gridpeers.scenarios.schema.scenario_writing import to_toml
from tests.scenario_files import problems, written

ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
CASE = '[case.IV]\ntitle = "fully coordinated"\nsecondary = "all"'


def with_plant(keys: str) -> str:
    """The scenario of islanding with more keys in `[plant]`."""
    return ISLANDING.replace("V_set0_pu = 1.0", f"V_set0_pu = 1.0\n{keys}")


def test_factors_and_an_inverters_own_data_reach_the_plant_and_the_agents(tmp_path: Path) -> None:
    """A factor acts on every inverter but those with a value of their own; the copy of a run says the same."""
    keys = "m_p_factor = 0.5\nm_q_factor = 2.0\nload_factor = 0.9\ninverter.inv3 = { m_p_pu = 0.02, P_rated_kW = 450 }"
    plain, _ = load_scenario("islanding")
    scenario, feeder = load_scenario(written(tmp_path, with_plant(keys)))
    plant, agents = configs(scenario, feeder, "IV")
    of = {agent.name: agent for agent in agents}
    tables = load_scenario("islanding")[1]

    assert (of["inv1"].m_p, of["inv1"].m_q) == (0.005, 0.1)
    assert (of["inv3"].m_p, of["inv3"].m_q, of["inv3"].P_rated) == (0.02, 0.1, 450e3)
    assert feeder.loads[0].S[0] == 0.9 * tables.loads[0].S[0]
    assert plant.settings.changes.inverters["inv3"].P_rated == 450e3
    assert configs(plain, tables, "IV")[0].settings.changes.inverters == {}
    assert load_scenario(written(tmp_path, to_toml(scenario, {}))) == (scenario, feeder)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("m_p_factor = 0", "plant.m_p_factor: 0 is not plausible for a factor on droops (0.01 to 100)"),
        ("inverter.inv3.m_p = 0.02", "plant.inverter.inv3.m_p: unknown key; write m_p_pu, per unit"),
        ("inverter.inv3 = {}", "plant.inverter.inv3: changes nothing; give it one of m_p_pu, m_q_pu, P_rated_kW"),
        ("inverter = 3", "plant.inverter: must be written as tables [plant.inverter.NAME], got 3"),
    ],
)
def test_data_that_cannot_be_meant_are_told_at_their_key(tmp_path: Path, keys: str, said: str) -> None:
    """Key, value with its unit, and what would be right."""
    found = problems(tmp_path, with_plant(keys))

    assert len(found) == 1
    assert said in found[0]


def test_trip_settings_are_judged_at_the_nominal_frequency(tmp_path: Path) -> None:
    """A limit of over-frequency at 50 Hz is one of under-frequency at 60 Hz."""
    trips = "\n[protection]\ntrips = { OF2 = [52.0, 0.16] }\n"
    told = problems(tmp_path, with_plant(trips))

    assert "OF2 must be between 60 and 120 Hz, got 52 Hz" in told[0]
    assert load_scenario(written(tmp_path, with_plant(f"f_nom_Hz = 50.0{trips}")))[1].f_nom == 50.0


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"all"', '["inv1", "inv44"]', 'case.IV.secondary: no inverter "inv44"; did you mean "inv4"?'),
        ('"all"', '["inv1", "inv1"]', 'case.IV.secondary: "inv1" is named twice; name it once'),
        ('"all"', "[]", 'case.IV.secondary: names no inverter; write secondary = "none"'),
        ('"all"', "3", 'case.IV.secondary: must be one of "none", "GFM", "all" or a list such as ["inv1", "inv4"]'),
        ('"all"', '["inv1"]\nwithout_agent = ["inv1"]', "case.IV.secondary: inv1 has no agent that could run the law"),
        ('"all"', '"all"\nwithout_agent = ["inv0"]', 'case.IV.without_agent: no inverter "inv0"'),
        (
            '"all"',
            '"all"\nwithout_agent = ["inv1","inv2","inv3","inv4","inv5","inv6","inv7","inv8","inv9"]',
            "case.IV.without_agent: no inverter is left that has an agent",
        ),
        (
            '"all"',
            '"all"\nwithout_agent = ["inv2"]\n[[case.IV.node]]\nname = "inv2"\nslow_s = 0.01',
            "case.IV.without_agent: an entry [[node]] is about the agent of inv2, so it must have one",
        ),
        (
            '"all"',
            '"all"\nwithout_agent = ["inv2"]\n[[event]]\nlabel = "e3"\nt_s = 5.0\nleave = ["inv2"]',
            'case.IV.without_agent: event "e3" lets the agent of inv2 leave or join, so it must have one',
        ),
    ],
)
def test_who_cannot_be_left_without_agent_or_run_the_law_is_told(tmp_path: Path, old: str, new: str, said: str) -> None:
    """Which name, and what to write."""
    text = ISLANDING.replace(CASE, CASE.replace(old, new)).replace('graph = "full"', "")
    text = text.replace("[case.IV]", '[case.IV]\ngraph = "full"')
    found = problems(tmp_path, text)

    assert len(found) == 1
    assert said in found[0]


CLOUDS = (CATALOGUE / "intermittency.toml").read_text(encoding="utf-8")


def test_a_case_has_its_own_available_power(tmp_path: Path) -> None:
    """A case's value for an inverter replaces the event's; the copy of a run has the same."""
    text = CLOUDS.replace("clouds = { inv2 = 275, inv5 = 275, inv8 = 275 }", "clouds = { inv2 = 275 }")
    scenario, _ = load_scenario(written(tmp_path, text))

    assert [limit.P_max for limit in limits_of(scenario, "275kW")] == [275e3, 350e3, 350e3]
    assert [limit.P_max for limit in limits_of(scenario, "350kW")] == [350e3, 350e3, 350e3]

    assert load_scenario(written(tmp_path, to_toml(scenario, {})))[0] == scenario


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("{ inv5 = -1 }", "inv5 can have from 0 to 350 kW available, got -1 kW"),
    ],
)
def test_a_limit_that_cannot_be_is_told_with_what_would_be_right(tmp_path: Path, wrong: str, told: str) -> None:
    """File, line, inverter, value and unit, and the range that makes sense."""
    text = CLOUDS.replace("{ inv2 = 350, inv5 = 350, inv8 = 350 }", wrong, 1)
    found = problems(tmp_path, text)

    number = next(number for number, line in enumerate(text.splitlines(), 1) if wrong in line)
    assert any(line.startswith(f"mine.toml:{number}: event[1].P_max_kW: ") and told in line for line in found)


def test_a_limited_inverter_gives_no_more_than_it_has_and_all_again_later() -> None:
    """P falls to the limit within its filter's time, the grid takes the rest, and P is back when the limit is."""
    settings = PlantSettings(
        limits=(PowerLimit(t=0.05, inverter="inv2", P_max=150e3), PowerLimit(t=0.6, inverter="inv2", P_max=350e3)),
    )
    plant = Plant(Network(read_feeder("microgrid123")), settings, 0.02, 0.01)
    for _ in range(60):
        plant.advance()
    rows = np.array(plant.take_rows())
    t, P = rows[:, 0], rows[:, 1 + 6 * plant.inverters.index("inv2") + 1]

    assert P[t < 0.05] == pytest.approx(0.647 * 350e3, rel=1e-3)
    assert P[(t > 0.5) & (t < 0.6)] == pytest.approx(150e3, rel=1e-2)
    assert P[-1] == pytest.approx(0.647 * 350e3, rel=1e-2)
    assert [(event.t, event.kind, event.subject) for event in plant.take_events()] == [
        (0.05, "limit", "inv2"),
        (0.6, "limit", "inv2"),
    ]
