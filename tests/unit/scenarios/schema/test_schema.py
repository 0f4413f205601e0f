"""Scenario files that can be run: what they mean, and that nothing is lost on the way through a run's copy."""

from __future__ import annotations

import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gridpeers.agents.agent_config import DegradedCommunication, Gains
from gridpeers.plant.plant_config import SyncCheck
from gridpeers.plant.tables.read import DATA
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.live.live_options import configure
from gridpeers.scenarios.results.history import late_moves, windows
from gridpeers.scenarios.schema import catalogue, load_scenario
from gridpeers.scenarios.schema.configs import configs, limits_of
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.wire.messages import PlantEvent
from tests.scenario_files import problems, written

SHORT = """
[time]
end_s = 1.0

[[event]]
label = "opens"
t_s = 0.5
open = ["13-152"]

[case.only]
secondary = "all"
graph = "full"
"""


@pytest.mark.parametrize("name", catalogue())
def test_every_scenario_of_the_catalogue_can_be_run(name: str) -> None:
    """Every scenario that comes with gridpeers has no problem and has the name of its file."""
    scenario, feeder = load_scenario(name)

    assert scenario.name == name
    assert scenario.title
    assert feeder.inverters


def test_the_configuration_of_an_agent_has_its_nameplate_and_the_rule_and_no_neighbour() -> None:
    """It names no other agent."""
    _, agents = configs(*load_scenario("islanding"), "IV", "tcp/127.0.0.1:7447")

    for agent in agents:
        text = msgspec.json.encode(agent).decode()
        assert [name for name in (other.name for other in agents) if f'"{name}"' in text] == [agent.name]
        assert agent.connect == ("tcp/127.0.0.1:7447",)


def test_a_case_changes_only_the_keys_of_degraded_communication_that_it_names(tmp_path: Path) -> None:
    """The other keys come from the common table, and agents get the result."""
    text = SHORT.replace("case.only", "case.degraded_communication")
    text += '[case.degraded_communication.degraded_communication]\nstale = "skip"\n\n'
    text += '[degraded_communication]\nT_age_s = 0.1\nweights = "degree-normalised"\n'

    scenario, feeder = load_scenario(written(tmp_path, text))
    agents = configs(scenario, feeder, "degraded_communication")[1]

    asked = DegradedCommunication(stale="skip", T_age=0.1, weights="degree-normalised")
    assert {agent.control.degraded_communication for agent in agents} == {asked}
    again, _ = load_scenario(written(tmp_path, to_toml(scenario, {})))
    assert again == scenario


def test_a_feeders_folder_is_found_beside_the_file(tmp_path: Path) -> None:
    """A relative path of a feeder starts at the scenario file, wherever the command is run."""
    (tmp_path / "mine").symlink_to(DATA / "microgrid123")
    text = SHORT + '[plant]\nfeeder = "mine"\n'

    scenario, _ = load_scenario(written(tmp_path, text))

    assert Path(scenario.plant.feeder).is_absolute()


finite = st.floats(min_value=1e-3, max_value=100.0)


@settings(max_examples=10)  # each example reads a feeder
@example(k_p=1.0, k_q=1.0, alpha=1.0, seed=0, title='"\\ ä%')
@given(
    k_p=finite, k_q=finite, alpha=finite, seed=st.integers(0, 2**31), title=st.text(max_size=20).filter(str.isprintable)
)
def test_the_copy_of_a_run_equals_the_scenario(
    tmp_path_factory: pytest.TempPathFactory, k_p: float, k_q: float, alpha: float, seed: int, title: str
) -> None:
    """Written out with all defaults and read again, a scenario is equal to itself, to the last bit."""
    scenario, _ = load_scenario("islanding")
    cases = scenario.cases | {"IV": msgspec.structs.replace(scenario.cases["IV"], gains=Gains(alpha=alpha))}
    gains = Gains(k_p=k_p, k_q=k_q)
    cases = {name: msgspec.structs.replace(case, gains=gains) if name != "IV" else case for name, case in cases.items()}
    drawn = msgspec.structs.replace(scenario, gains=gains, seed=seed, title=title, cases=cases)
    path = written(tmp_path_factory.mktemp("copy"), to_toml(drawn, {"driver": "inprocess"}))

    again, _ = load_scenario(path)

    assert again == drawn


def test_a_synchronised_event_closes_its_switches_in_step(tmp_path: Path) -> None:
    """The keys reach the plant: only closing switches wait, and the windows are in the units of their keys."""
    path = tmp_path / "resync.toml"
    path.write_text("""
[time]
end_s = 2.0
[plant.sync_check]
f_Hz = 0.2
timeout_s = 3.0
[[event]]
label = "apart"
t_s = 0.5
open = ["13-152"]
[[event]]
label = "together"
t_s = 1.0
close = ["13-152"]
open = ["60-160"]
synchronised = true
[case.IV]
secondary = "all"
graph = "full"
""")
    plant = configs(*load_scenario(str(path)), "IV")[0].settings

    assert plant.sync_check == SyncCheck(f=0.2, timeout=3.0)
    waits = {(event.t, event.switch): event.synchronised for event in plant.events}
    assert waits == {(0.5, "13-152"): False, (1.0, "13-152"): True, (1.0, "60-160"): False}


ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
CASE = '[case.IV]\ntitle = "fully coordinated"\nsecondary = "all"'


def with_plant(keys: str) -> str:
    """The scenario of islanding with more keys in `[plant]`."""
    return ISLANDING.replace("V_set0_pu = 1.0", f"V_set0_pu = 1.0\n{keys}")


def test_factors_and_an_inverters_own_data_reach_the_plant_and_the_agents(tmp_path: Path) -> None:
    """A factor acts on every inverter without a value of its own; the copy of a run has the same."""
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


@pytest.mark.parametrize(("keys", "said"), [
    ("inverter.inv3 = {}", "plant.inverter.inv3: changes nothing; give it one of m_p_pu, m_q_pu, P_rated_kW"),
    ("inverter = 3", "plant.inverter: must be written as tables [plant.inverter.NAME], got 3"),
])  # fmt: skip
def test_implausible_data_are_a_problem_at_their_key(tmp_path: Path, keys: str, said: str) -> None:
    """It has the key, the value with its unit, and the right values."""
    found = problems(tmp_path, with_plant(keys))

    assert len(found) == 1
    assert said in found[0]


def test_trip_settings_are_judged_at_the_nominal_frequency(tmp_path: Path) -> None:
    """A limit of over-frequency at 50 Hz is one of under-frequency at 60 Hz."""
    trips = "\n[protection]\ntrips = { OF2 = [52.0, 0.16] }\n"
    told = problems(tmp_path, with_plant(trips))

    assert "OF2 must be between 60 and 120 Hz, got 52 Hz" in told[0]
    assert load_scenario(written(tmp_path, with_plant(f"f_nom_Hz = 50.0{trips}")))[1].f_nom == 50.0


@pytest.mark.parametrize(("old", "new", "said"), [
    ('"all"', '["inv1", "inv44"]', 'case.IV.secondary: no inverter "inv44"; did you mean "inv4"?'),
    ('"all"', '["inv1", "inv1"]', 'case.IV.secondary: "inv1" is named twice; name it once'),
    ('"all"', "[]", 'case.IV.secondary: names no inverter; write secondary = "none"'),
    ('"all"', '["inv1"]\nwithout_agent = ["inv1"]', "case.IV.secondary: inv1 has no agent to run the law"),
    ('"all"', '"all"\nwithout_agent = ["inv0"]', 'case.IV.without_agent: no inverter "inv0"'),
    (
        '"all"',
        '"all"\nwithout_agent = ["inv1","inv2","inv3","inv4","inv5","inv6","inv7","inv8","inv9"]',
        "case.IV.without_agent: no inverter has an agent",
    ),
    (
        '"all"',
        '"all"\nwithout_agent = ["inv2"]\n[[case.IV.node]]\nname = "inv2"\nslow_s = 0.01',
        "case.IV.without_agent: an entry [[node]] names inv2, so it must have an agent",
    ),
    (
        '"all"',
        '"all"\nwithout_agent = ["inv2"]\n[[event]]\nlabel = "e3"\nt_s = 5.0\nleave = ["inv2"]',
        'case.IV.without_agent: event "e3" lets the agent of inv2 leave or join, so it must have one',
    ),
])  # fmt: skip
def test_impossible_names_without_an_agent_or_with_the_law_are_a_problem(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    """It has the name, and what to write."""
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


PLUG = (CATALOGUE / "plug-n-play.toml").read_text(encoding="utf-8")


def test_a_spare_that_joins_is_configured_but_not_awaited_at_the_start(tmp_path: Path) -> None:
    """The plant has its inverter and starts without it."""
    scenario, feeder = load_scenario(written(tmp_path, PLUG.replace('join = ["inv2"]', 'join = ["inv2", "inv10"]')))
    plant, agents = configs(scenario, feeder, "IV")

    assert plant.settings.spares == ("inv10",)
    assert agents[-1].name == "inv10"
    assert "inv10" not in plant.agents
    assert [row.name for row in inverters_of(scenario, feeder)][-1] == "inv10"


def test_in_a_live_run_people_move_the_agents(tmp_path: Path) -> None:
    """The plant of a live run has no schedule of agents, and knows each inverter once."""
    text = PLUG.replace('join = ["inv2"]', 'join = ["inv2", "inv10"]')
    plant, agents = configure(*load_scenario(written(tmp_path, text)), "tcp/127.0.0.1:7447", run="lab")

    assert plant.schedule == ()
    assert [agent.name for agent in agents] == [f"inv{i}" for i in range(1, 11)]


@pytest.mark.parametrize(("old", "new", "said"), [
    (
        'leave = ["inv2"]',
        'leave = ["inv10", "inv2"]',
        r'event\[1\].leave: "inv10" is not in the run at 2 s; leave it out',
    ),
    (
        'join = ["inv2"]',
        'leave = ["inv2"]',
        r'event\[2\].leave: "inv2" is not in the run at 3 s; .* let it join before',
    ),
    ("t_s = 2.0", "t_s = 2.01", r"event\[1\].t_s: 2.01 s is not a multiple of T_c_s = 0.02 s, .* nearest is 2"),
])  # fmt: skip
def test_each_problem_has_its_place_and_a_remedy(tmp_path: Path, old: str, new: str, said: str) -> None:
    """A problem names the file, the line, the key, the value, and what to write instead."""
    assert PLUG.count(old) == 1
    found = problems(tmp_path, PLUG.replace(old, new))

    assert any(re.search(said, line) for line in found), found
    assert all(line.startswith("mine.toml:") for line in found)


def test_a_window_starts_when_its_event_happened() -> None:
    """A late join moves the start of its window and is reported; a join that never happens keeps its time."""
    scenario, _ = load_scenario("plug-n-play")
    left = PlantEvent(t=2.0, kind="inverter", subject="inv2", text="inv2 disconnected")
    back = PlantEvent(t=3.32, kind="inverter", subject="inv2", text="inv2 connected")
    other = PlantEvent(t=3.5, kind="inverter", subject="inv3", text="inv3 disconnected")

    came, kept = ({it.label: it.start for it in windows(scenario, of)} for of in ([left, back, other], [left]))
    assert came == {"islanding": 1.0, "leave": 2.0, "return": 3.32}
    assert kept == {"islanding": 1.0, "leave": 2.0, "return": 3.0}
    assert late_moves(scenario, [left]) == []
    assert late_moves(scenario, [left, back])[0].startswith("return, planned for t = 3 s, came at 3.32 s")


def test_a_saved_run_with_a_removed_key_can_be_read(tmp_path: Path) -> None:
    """The default of a removed key is ignored; another value is refused."""
    load_scenario(written(tmp_path, f"{PLUG}\n[plant.helics]\nfederates = 0\n"))

    assert "unknown key" in problems(tmp_path, f"{PLUG}\n[plant.helics]\nfederates = 2\n")[0]
