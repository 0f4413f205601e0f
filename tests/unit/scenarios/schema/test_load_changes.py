"""Loads that a scenario's events change: what reaches the plant, what a file says of it, and what is noted."""

from __future__ import annotations

from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.plant.plant_config import LoadEvent
from gridpeers.scenarios.results.plots.drawing import happening
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.schema.supply import powers_after, supply_notes
from gridpeers.wire.messages import LoadSetting
from tests.scenario_files import problems, written

TEXT = """
[time]
end_s = 3.0
[[event]]
label = "islanding"
t_s = 1.0
open = ["13-152"]
[[event]]
label = "step"
t_s = 1.5
load = { 48 = { factor = 1.5 }, 65 = { P_kW = 0, Q_kvar = 0 } }
[[event]]
label = "back"
t_s = 2.0
load.48.Q_kvar = 10.5
load.65.factor = 1
[case.IV]
secondary = "all"
graph = "full"
"""


def test_changes_of_loads_reach_the_plant(tmp_path: Path) -> None:
    """In the order of time, in SI units, and what is left out stays left out."""
    plant, _ = configs(*load_scenario(written(tmp_path, TEXT)), "IV")

    assert plant.settings.loads == (
        LoadEvent(t=1.5, load="48", setting=LoadSetting(factor=1.5)),
        LoadEvent(t=1.5, load="65", setting=LoadSetting(P=0.0, Q=0.0)),
        LoadEvent(t=2.0, load="48", setting=LoadSetting(Q=10_500.0)),
        LoadEvent(t=2.0, load="65", setting=LoadSetting(factor=1.0)),
    )


def test_a_written_scenario_has_its_loads(tmp_path: Path) -> None:
    """The copy that a run leaves is the same scenario, with no key that nobody gave."""
    scenario, feeder = load_scenario(written(tmp_path, TEXT))
    text = to_toml(scenario, {})

    assert "load = { 48 = { factor = 1.5 }, 65 = { P_kW = 0.0, Q_kvar = 0.0 } }\n" in text
    assert text.count("\nload = ") == 2
    assert load_scenario(written(tmp_path, text)) == (scenario, feeder)


def test_a_power_that_is_left_out_stays(tmp_path: Path) -> None:
    """After each event a load has what the events until then say, together."""
    powers = [powers for _, powers in powers_after(*load_scenario(written(tmp_path, TEXT)))]

    assert powers == [
        {},
        {"48": 315e3 + 225e3j, "65": 0j},
        {"48": 315e3 + 10.5e3j, "65": pytest.approx(140e3 + 100e3j)},
    ]


def test_a_load_is_named_by_its_bus_once(tmp_path: Path) -> None:
    """What is wrong with the loads of all events is told at once."""
    found = problems(tmp_path, TEXT.replace("factor = 1.5", "P_kW = 1e9").replace("65.factor", "650.factor"))

    assert [text.partition(" ")[0] for text in found] == ["mine.toml:11:", "mine.toml:12:"]
    assert "event[1].load.48: 1e+09 kW is not plausible for the real power of a load (0 to " in found[0]
    assert 'event[2].load: load "650": no such load; did you mean "65"?' in found[1]


def test_an_island_is_noted_with_the_load_that_it_has_then(tmp_path: Path) -> None:
    """A load that an event raises may be more than an island's inverters are rated for."""
    heavy = TEXT.replace("factor = 1.5", "factor = 10")
    light, notes = (supply_notes(*load_scenario(written(tmp_path, text))) for text in (TEXT, heavy))

    assert light == ()
    assert len(notes) == 2
    assert notes[0].startswith('event "step" at 1.5 s leaves 5')
    assert "more than they can feed" in notes[0]


def test_a_figure_says_what_happens_to_loads(tmp_path: Path) -> None:
    """One load by its name and power; several by their number."""
    scenario, _ = load_scenario(written(tmp_path, TEXT.replace("load.65.factor = 1\n", "")))

    assert [happening(event, scenario) for event in scenario.events] == [
        "13-152 opens",
        "2 loads change",
        "load 48: 10.5 kvar",
    ]


def test_a_sweep_and_a_change_in_python_reach_a_load(tmp_path: Path) -> None:
    """The factor of one load is a key like any."""
    scenario = gp.load(written(tmp_path, TEXT)).replace({"event[1].load.48.factor": 0.5})

    assert scenario.spec.events[1].load["48"].factor == 0.5
