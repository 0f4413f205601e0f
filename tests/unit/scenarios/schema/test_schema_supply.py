"""Islands that nothing feeds are refused where a run would begin with them, and reported where an event makes them."""

import re
import shutil
from pathlib import Path

import pytest

from gridpeers.plant.tables.read import DATA
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.supply import supply_notes
from tests.command_line import invoke
from tests.scenario_files import problems, written

ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
MINE = ISLANDING.replace('feeder = "microgrid123"', 'feeder = "mine"')


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of microgrid123 to change, beside the scenario file."""
    return Path(shutil.copytree(DATA / "microgrid123", tmp_path / "mine"))


def replace(folder: Path, file: str, old: str, new: str) -> None:
    """Change a table."""
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


def test_an_open_switch_that_cuts_off_load_at_the_start_is_refused(tmp_path: Path, folder: Path) -> None:
    """Load behind a switch that is open in the beginning is a problem if nothing stands there to feed it."""
    replace(folder, "switches.csv", "60,160,ABC,closed", "60,160,ABC,open")
    replace(folder, "switches.csv", "13,152,ABC,closed", "13,152,ABC,open")
    text = re.sub(r"(?s)\[\[event\]\].*?(?=\[case)", "", MINE)

    (found,) = problems(tmp_path, text)

    assert "at t = 0 nothing feeds 18 buses (52, 53, 54," in found
    assert "1360 kW of load: " in found


def test_a_feeder_of_followers_alone_runs_with_the_grid_and_a_note_tells_the_blackout(
    tmp_path: Path, folder: Path
) -> None:
    """A blackout may be meant: the event that makes it is told in a note, with what goes dark."""
    replace(folder, "inverters.csv", ",GFM,", ",GFL,")

    notes = supply_notes(*load_scenario(written(tmp_path, MINE)))

    assert len(notes) == 1
    assert re.match(r'event "event1" at 1 s de-energises \d+ buses \(.*\) with \d+ kW of load and inv1, inv2', notes[0])
    assert "no grid-forming inverter" in notes[0]


def test_the_zone_that_the_paper_drops_is_told() -> None:
    """Event 2 of the islanding experiment de-energises the passive zone and no inverter."""
    (note,) = supply_notes(*load_scenario("islanding"))

    assert note.startswith('event "event2" at 4 s de-energises 18 buses (52, 53, 54, ')
    assert "with 1360 kW of load: " in note


def test_the_last_leader_that_leaves_is_told(tmp_path: Path) -> None:
    """An agent that leaves takes its inverter with it, and an island its frequency if it was the last leader."""
    text = ISLANDING.replace('open = ["60-160"]', 'leave = ["inv1", "inv4", "inv7"]')

    (note,) = supply_notes(*load_scenario(written(tmp_path, text)))

    assert note.startswith('event "event2" at 4 s de-energises ')
    assert "inv2, inv3, inv5, inv6, inv8, inv9" in note


@pytest.mark.parametrize("name", [path.stem for path in CATALOGUE.glob("*.toml")])
def test_no_catalogue_scenario_stops_an_inverter(name: str) -> None:
    """Where nothing is said of inverters, none loses its leader in the catalogue."""
    assert not any(" and inv" in note for note in supply_notes(*load_scenario(name)))


def test_an_island_with_more_load_than_rating_is_told(tmp_path: Path, folder: Path) -> None:
    """One inverter of 600 kW cannot feed what is left to it: the event that leaves it so is told, with both powers."""
    table = (folder / "inverters.csv").read_text().splitlines(keepends=True)
    (folder / "inverters.csv").write_text("".join(table[:2]))

    notes = supply_notes(*load_scenario(written(tmp_path, MINE)))

    assert notes[0] == (
        'event "event1" at 1 s leaves 3431 kW of load to an island of inv1, rated 600 kW together: '
        "more than they can feed"
    )


def test_check_prints_its_notes_and_tries_the_operating_point(tmp_path: Path, folder: Path) -> None:
    """A feeder whose lines are too long to carry its load is found by solving it: no table shows it."""
    code, said = invoke("check", "islanding")
    assert (code, said.startswith('NOTE  event "event2" at 4 s de-energises 18 buses ')) == (0, True)
    lines = [line.split(",") for line in (folder / "lines.csv").read_text().splitlines()]
    longer = [lines[0], *([*line[:5], str(60.0 * float(line[5])), *line[6:]] for line in lines[1:])]
    (folder / "lines.csv").write_text("".join(f"{','.join(line)}\n" for line in longer))

    code, said = invoke("check", str(written(tmp_path, MINE)))

    assert code == 2
    assert "the plant cannot start: no initial operating point" in said
