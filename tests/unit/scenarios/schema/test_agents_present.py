"""Events that let agents leave and join: what they mean, and every problem that can be made in them."""

import re
from pathlib import Path

import pytest

from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.live.live_options import LiveOptions, configure
from gridpeers.scenarios.results.event_windows import as_they_came, late_moves
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.wire.messages import PlantEvent
from tests.scenario_files import problems, written

PLUG = (CATALOGUE / "plug-n-play.toml").read_text(encoding="utf-8")


def test_a_spare_that_joins_is_there_but_not_awaited_at_the_start(tmp_path: Path) -> None:
    """Its agent is configured like the others, the plant has its inverter, and begins without it."""
    scenario, feeder = load_scenario(written(tmp_path, PLUG.replace('join = ["inv2"]', 'join = ["inv2", "inv10"]')))
    plant, agents = configs(scenario, feeder, "IV")

    assert plant.settings.spares == ("inv10",)
    assert agents[-1].name == "inv10"
    assert "inv10" not in plant.agents
    assert [row.name for row in inverters_of(scenario, feeder)][-1] == "inv10"


def test_in_a_live_run_people_move_the_agents(tmp_path: Path) -> None:
    """The plant of a live run lets nobody leave by itself, and knows each inverter once."""
    text = PLUG.replace('join = ["inv2"]', 'join = ["inv2", "inv10"]')
    plant, agents = configure(*load_scenario(written(tmp_path, text)), LiveOptions(run="lab"), "tcp/127.0.0.1:7447")

    assert plant.schedule == ()
    assert [agent.name for agent in agents] == [f"inv{i}" for i in range(1, 11)]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('leave = ["inv2"]', 'leave = ["inv2", "inv2"]', r'event\[1\].leave: "inv2" is named twice in event "leave"'),
        (
            'leave = ["inv2"]',
            'leave = ["inv10", "inv2"]',
            r'event\[1\].leave: "inv10" is not there at 2 s; leave it out',
        ),
        ('join = ["inv2"]', 'leave = ["inv2"]', r'event\[2\].leave: "inv2" is not there at 3 s; .* let it join before'),
        ("t_s = 2.0", "t_s = 2.01", r"event\[1\].t_s: 2.01 s is not a multiple of T_c_s = 0.02 s, .* nearest is 2"),
        ('join = ["inv2"]', 'joins = ["inv2"]', r'event\[2\].joins: unknown key; did you mean "join"\?'),
    ],
)
def test_each_problem_is_told_with_its_place_and_what_would_be_right(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    """A problem names the file, the line, the key, the value, and what to write instead."""
    assert PLUG.count(old) == 1
    found = problems(tmp_path, PLUG.replace(old, new))

    assert any(re.search(said, line) for line in found), found
    assert all(line.startswith("mine.toml:") for line in found)


def test_an_event_is_measured_from_when_it_came() -> None:
    """A process that came up late schedule the start of its window, which is told; what never came keeps its time."""
    scenario, _ = load_scenario("plug-n-play")
    left = PlantEvent(t=2.0, kind="inverter", subject="inv2", text="inv2 disconnected")
    back = PlantEvent(t=3.32, kind="inverter", subject="inv2", text="inv2 connected")
    other = PlantEvent(t=3.5, kind="inverter", subject="inv3", text="inv3 disconnected")

    assert as_they_came(scenario, [left, back, other]) == [("islanding", 1.0), ("leave", 2.0), ("return", 3.32)]
    assert as_they_came(scenario, [left]) == [("islanding", 1.0), ("leave", 2.0), ("return", 3.0)]
    assert late_moves(scenario, [left]) == []
    assert late_moves(scenario, [left, back])[0].startswith("return, meant for t = 3 s, came at 3.32 s")
