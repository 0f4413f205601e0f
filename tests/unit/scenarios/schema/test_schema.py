"""Scenario files that can be run: what they mean, and that nothing is lost on the way through a run's copy."""

from pathlib import Path

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gridpeers.agents.agent_config import DegradedCommunication, Gains
from gridpeers.plant.plant_config import SwitchEvent, SyncCheck
from gridpeers.plant.tables.read import DATA
from gridpeers.scenarios.schema import catalogue, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.scenario_writing import to_toml
from tests.scenario_files import written

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
    """Every scenario that comes with gridpeers has no problem and is named as its file."""
    scenario, feeder = load_scenario(name)

    assert scenario.name == name
    assert scenario.title
    assert feeder.inverters


def test_islanding_is_the_papers_experiment() -> None:
    """Section 4: event 1 opens 13-152 at 1 s, event 2 opens 60-160 at 4 s, in four cases."""
    scenario, feeder = load_scenario("islanding")
    plant, agents = configs(scenario, feeder, "III")

    assert plant.settings.events == (
        SwitchEvent(t=1.0, switch="13-152", action="open"),
        SwitchEvent(t=4.0, switch="60-160", action="open"),
    )
    assert (plant.T_c, plant.settings.h, plant.end) == (0.02, 0.002, 7.0)
    assert [agent.name for agent in agents if agent.kind == "GFM"] == ["inv1", "inv4", "inv7"]
    rules = {name: (case.secondary, case.graph) for name, case in scenario.cases.items()}
    assert rules == {"I": ("none", "none"), "II": ("GFM", "none"), "III": ("GFM", "GFM-only"), "IV": ("all", "full")}


def test_an_agent_is_told_its_own_nameplate_and_the_rule_and_no_neighbour() -> None:
    """The configuration of an agent names nobody but itself."""
    _, agents = configs(*load_scenario("islanding"), "IV", "tcp/127.0.0.1:7447")

    for agent in agents:
        text = msgspec.json.encode(agent).decode()
        assert [name for name in (other.name for other in agents) if f'"{name}"' in text] == [agent.name]
        assert agent.connect == ("tcp/127.0.0.1:7447",)


def test_a_case_changes_only_the_gains_it_names(tmp_path: Path) -> None:
    """[case.NAME.gains] starts from [gains], not from the defaults."""
    text = SHORT + "[case.only.gains]\nalpha = 3.0\n\n[gains]\nk_q = 0.5\n"

    scenario, _ = load_scenario(written(tmp_path, text))

    assert scenario.cases["only"].gains == Gains(alpha=3.0, k_q=0.5)


def test_a_case_changes_only_the_handling_it_names_and_agents_are_told(tmp_path: Path) -> None:
    """A case's table starts from the common one, also in a case of that name, and agents get the result."""
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
def test_a_runs_copy_means_the_same_as_the_scenario(
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
    """The keys reach the plant: only what is closed waits, and the windows are in the units of their keys."""
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
