"""Islands and loads that nothing feeds, and what `gridpeers check` says beside: loads and supply."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from gridpeers.plant.plant_config import LoadEvent
from gridpeers.plant.tables.read import DATA
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import ScenarioError, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.supply import supply_notes
from gridpeers.wire.messages import LoadSetting
from tests.command_line import invoke
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
    """In the order of time and in SI units; a power that is left out stays unset."""
    plant, _ = configs(*load_scenario(written(tmp_path, TEXT)), "IV")

    assert plant.settings.loads == (
        LoadEvent(t=1.5, load="48", setting=LoadSetting(factor=1.5)),
        LoadEvent(t=1.5, load="65", setting=LoadSetting(P=0.0, Q=0.0)),
        LoadEvent(t=2.0, load="48", setting=LoadSetting(Q=10_500.0)),
        LoadEvent(t=2.0, load="65", setting=LoadSetting(factor=1.0)),
    )


def test_a_load_is_named_by_its_bus_once(tmp_path: Path) -> None:
    """All problems of the loads of all events come at once."""
    found = problems(tmp_path, TEXT.replace("factor = 1.5", "P_kW = 1e9").replace("65.factor", "650.factor"))

    assert [text.partition(" ")[0] for text in found] == ["mine.toml:11:", "mine.toml:12:"]
    assert "event[1].load.48: 1e+09 kW is not plausible for the real power of a load (0 to " in found[0]
    assert 'event[2].load: load "650": no such load; did you mean "65"?' in found[1]


def test_a_note_on_an_island_has_its_load_at_that_time(tmp_path: Path) -> None:
    """An event may raise a load above the rating of the inverters of an island."""
    heavy = TEXT.replace("factor = 1.5", "factor = 10")
    light, notes = (supply_notes(*load_scenario(written(tmp_path, text))) for text in (TEXT, heavy))

    assert light == ()
    assert len(notes) == 2
    assert notes[0].startswith('event "step" at 1.5 s leaves 5')
    assert "which is too little" in notes[0]


ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
MINE = ISLANDING.replace('feeder = "microgrid123"', 'feeder = "mine"')


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of microgrid123 to change, beside the scenario file."""
    return Path(shutil.copytree(DATA / "microgrid123", tmp_path / "mine"))


def replace(folder: Path, file: str, old: str, new: str) -> None:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))


def test_a_feeder_of_followers_alone_cannot_begin_without_the_grid(tmp_path: Path, folder: Path) -> None:
    """Grid-following inverters need a voltage to follow: without substation and GFM there is none at t = 0."""
    replace(folder, "inverters.csv", ",GFM,", ",GFL,")
    (folder / "source.csv").unlink()

    (found,) = problems(tmp_path, MINE)

    assert re.search(
        r"plant.feeder: at t = 0 nothing feeds 134 buses \(1, 2, .*\) with 4\d{3} kW of load and inv1, inv2, .*: "
        r"neither the substation nor a grid-forming inverter is connected to them",
        found,
    ), found


def test_the_departure_of_the_last_leader_is_noted(tmp_path: Path) -> None:
    """An agent that leaves takes its inverter off the network, and an island without a leader has no voltage."""
    text = ISLANDING.replace('open = ["60-160"]', 'leave = ["inv1", "inv4", "inv7"]')

    (note,) = supply_notes(*load_scenario(written(tmp_path, text)))

    assert note.startswith('event "event2" at 4 s de-energises ')
    assert "inv2, inv3, inv5, inv6, inv8, inv9" in note


def test_an_island_with_more_load_than_rating_is_noted(tmp_path: Path, folder: Path) -> None:
    """The note has the event, and both powers: one inverter of 600 kW cannot feed the island."""
    table = (folder / "inverters.csv").read_text().splitlines(keepends=True)
    (folder / "inverters.csv").write_text("".join(table[:2]))

    notes = supply_notes(*load_scenario(written(tmp_path, MINE)))

    assert notes[0] == (
        'event "event1" at 1 s leaves 3431 kW of load to an island of inv1, rated 600 kW together, which is too little'
    )


def test_check_prints_its_notes_and_tries_the_operating_point(tmp_path: Path, folder: Path) -> None:
    """A feeder with lines too long to carry its load is found by solving it, as no table shows it."""
    code, said = invoke("check", "islanding")
    assert (code, said.startswith('NOTE  event "event2" at 4 s de-energises 18 buses ')) == (0, True)
    lines = [line.split(",") for line in (folder / "lines.csv").read_text().splitlines()]
    longer = [lines[0], *([*line[:5], str(60.0 * float(line[5])), *line[6:]] for line in lines[1:])]
    (folder / "lines.csv").write_text("".join(f"{','.join(line)}\n" for line in longer))

    code, said = invoke("check", str(written(tmp_path, MINE)))

    assert code == 2
    assert "the plant cannot start: no initial operating point" in said


LIARS = """
[time]
end_s = 2.0
[case.I]
secondary = "all"
graph = "full"
[case.II]
secondary = "all"
graph = "full"
[[case.II.node]]
name = "inv2"
to_s = 1.5
lies = { model = "freeze", in_name_of = "inv5", plant = true }
[[node]]
name = "inv3"
from_s = 1.0
lies = { model = "offset", P_set_W = 1e5 }
"""


def test_a_lie_in_another_name_is_refused_with_certificates(tmp_path: Path) -> None:
    """With `security = "mtls"` such an entry is a problem at its key."""
    (tmp_path / "liars.toml").write_text('security = "mtls"\n' + LIARS, encoding="utf-8")

    with pytest.raises(ScenarioError, match=r"case\.II\.node\[0\]\.lies\.in_name_of: certificates exclude this lie"):
        load_scenario(tmp_path / "liars.toml")
