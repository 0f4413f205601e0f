"""Scenario files that cannot be run: what is said of each problem, beside those of `tests/golden/problems`."""

from __future__ import annotations

import csv
import re
import shutil
from pathlib import Path

import pytest

from gridpeers.plant.tables.read import DATA
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import ScenarioError, load_scenario
from tests.scenario_files import problems, written

ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(("old", "new", "said"), [
    ("T_c_s = 0.02", "T_c_s = 0", r"time.T_c_s: a control period must be above 0, got 0 s"),
    (
        "h_s = 0.002",
        "h_s = 0.005",
        r"time.h_s: 0.005 s is too long a step to resolve T_p_s = 0.01 s of \[plant.gfm\]; at most 0.003 s",
    ),
    ("end_s = 7.0", "", r"time.end_s: is missing; write a number"),
    ("t_s = 4.0", "t_s = 4.001", r"event\[1\].t_s: 4.001 s is not a multiple of h_s = 0.002 s"),
    ('"60-160"', '"13-152"', r'event\[1\].open: switch "13-152" is open already at 4 s'),
    ('graph = "full"', 'graph = "mesh"', r'case.IV.graph: there is no graph "mesh"; the graphs are full, none'),
    ('feeder = "microgrid123"', 'feeder = "microgrid"', r'plant.feeder: feeder "microgrid": no such feeder'),
    ('feeder = "microgrid123"', 'feeder = "standard123"', r"(?s)plant.(feeder|load_set): "),
    (
        "[plant]",
        "[plant.gfm]\nP_min_pu = 0.7\n\n[plant]",
        r"plant.P_set0_pu: 0.647 pu is below plant.gfm.P_min_pu = 0.7 pu.*raise P_set0_pu",
    ),
    (
        "[plant]",
        "[protection]\ntrips = { UV2 = [0.4, 0.0] }\n\n[plant]",
        r"protection.trips: UV2: the clearing time must be above 0 and at most 3600 s, got 0 s",
    ),
    (
        "[plant]",
        "[protection]\ntrips = { OF1 = [62.5, 1.0] }\n\n[plant]",
        r"protection.trips: OF2 = 62 Hz must be farther from nominal than OF1 = 62.5 Hz",
    ),
])  # fmt: skip
def test_each_problem_has_its_place_and_a_remedy(tmp_path: Path, old: str, new: str, said: str) -> None:
    """A problem names the file, the line, the key, the value with its unit, and what to write instead."""
    assert ISLANDING.count(old) >= 1
    found = problems(tmp_path, ISLANDING.replace(old, new, 1))

    assert len(found) == 1, found
    assert re.search(said, found[0]), found[0]


def test_the_longest_step_depends_on_the_method(tmp_path: Path) -> None:
    """10 ms, the shortest time constant, is a step of the second-order method, but not of the default."""
    longer = ISLANDING.replace("h_s = 0.002", "h_s = 0.01")
    second_order = longer.replace("h_s = 0.01", 'h_s = 0.01\nmethod = "second-order"')

    (problem,) = problems(tmp_path, longer)
    (faster,) = problems(tmp_path, second_order + "\n[plant.gfm]\nT_p_s = 0.008\n")

    assert "time.h_s: 0.01 s is too long a step to resolve T_p_s = 0.01 s" in problem
    assert "time.h_s: 0.01 s is too long a step to resolve T_p_s = 0.008 s of [plant.gfm]" in faster
    assert faster.endswith("at most 0.008 s, 1 of the shortest time constant")
    assert load_scenario(written(tmp_path, second_order))[0].time.h_s == 0.01


def test_an_unknown_feeder_hides_only_what_depends_on_it(tmp_path: Path) -> None:
    """Links, faults of agents and events are checked without it, except their names."""
    text = ISLANDING.replace('feeder = "microgrid123"', 'feeder = "microgrid124"').replace('open = ["60-160"]', "")
    text += """
[[case.IV.link]]
on = "inv1 <-> anybody"
from_s = 9.0
delay = 0.1
[[case.IV.link]]
on = "inv1"
delay = 0.1
[[node]]
name = "inv2"
pause = true
from_s = 1.0
"""

    found = problems(tmp_path, text)

    assert [re.sub(r".*?: ([^:]*): .*", r"\1", line) for line in found] == [
        "plant.feeder",
        "event[1]",
        "case.IV.link[0].from_s",
        "case.IV.link[1].on",
        "node[0].pause",
    ]


def test_an_event_off_its_grid_is_still_compared_with_the_others(tmp_path: Path) -> None:
    """Both problems of its time are reported."""
    text = ISLANDING.replace("t_s = 4.0", "t_s = 0.9995").replace("end_s = 7.0", "end_s = 0.501")

    found = [re.sub(r".*?: ([^:]*: .*?)[;,(].*", r"\1", line) for line in problems(tmp_path, text)]

    assert found == [
        "time.end_s: 0.501 s is not a multiple of T_c_s = 0.02 s",
        'event[0].t_s: event "event1" at 1 s is not before the end at 0.501 s',
        "event[1].t_s: 0.9995 s is not a multiple of h_s = 0.002 s",
        'event[1].t_s: event "event2" at 0.9995 s is not before the end at 0.501 s',
        'event[1].t_s: event "event2" at 0.9995 s is written after "event1" at 1 s',
    ]


def test_a_feeders_problems_are_passed_on(tmp_path: Path) -> None:
    """Every problem of the feeder is reported with its table and row."""
    folder = Path(shutil.copytree(DATA / "microgrid123", tmp_path / "broken"))
    with (folder / "inverters.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))
    rows[1][2], rows[2][2] = "999", rows[3][2]
    with (folder / "inverters.csv").open("w", newline="") as stream:
        csv.writer(stream).writerows(rows)

    found = problems(tmp_path, ISLANDING.replace('feeder = "microgrid123"', 'feeder = "broken"'))

    assert len(found) >= 2
    assert all(line.startswith('feeder "broken": inverters.csv row ') for line in found), found


@pytest.mark.parametrize(("text", "said"), [
    ("seed = 1\nseed 2\n", r"mine.toml:2: not valid TOML: .*: seed 2"),
    ("", r"mine.toml: is empty; gridpeers init my-study makes a project"),
    ("time = 3\ncase = 4\nevent = 5\n", r"mine.toml:1: time: must be a table"),
    ("[time]\nend_s = 1.0\n", r"case: is missing; write at least one table \[case.NAME\]"),
    ("[time]\nend_s = 1.0\n[case]\n", r"case: there is no case; write at least one table"),
])  # fmt: skip
def test_a_malformed_file_is_reported_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    """Any text gives problems, never a traceback."""
    assert any(re.search(said, line) for line in problems(tmp_path, text)), problems(tmp_path, text)


@pytest.mark.parametrize("name", ["süd", "su\u0308d", "my study (2)", "東京", "_"])
def test_a_scenario_is_not_refused_by_the_name_of_its_file(tmp_path: Path, name: str) -> None:
    """A scenario without a name gets one from its file, in whatever form the system stores that."""
    path = tmp_path / f"{name}.toml"
    path.write_text(re.sub(r"(?m)^name = .*$", "", (CATALOGUE / "islanding.toml").read_text()))

    scenario, _ = load_scenario(path)

    assert scenario.name in ("sud", "my-study-2", "scenario")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le"])
def test_a_scenario_that_powershell_wrote_is_read(tmp_path: Path, encoding: str) -> None:
    """Its `>` writes UTF-16, and other programs a mark before UTF-8."""
    path = tmp_path / "mine.toml"
    path.write_bytes((CATALOGUE / "islanding.toml").read_text().replace("\n", "\r\n").encode(encoding))

    assert load_scenario(path) == load_scenario("islanding")


@pytest.mark.parametrize(("name", "said"), [
    ("islandin", r'no scenario "islandin"; did you mean "islanding"\?'),
    ("no/such.toml", r"no/such.toml: there is no such file"),
    (".", r"\.: this is a folder"),
])  # fmt: skip
def test_a_missing_scenario_is_reported(name: str, said: str) -> None:
    """The message lists the scenarios of the catalogue."""
    with pytest.raises(ScenarioError, match=said):
        load_scenario(name)


BASE = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
LINK = BASE + '\n[[link]]\non = "inv1 -> inv2"\n'


@pytest.mark.parametrize(("text", "said"), [
    (BASE + "\nx = " + "{a=" * 3000, "not valid TOML: "),
    (BASE.replace("seed = 1 ", f"seed = {'1' * 5000} "), "not valid TOML: Exceeds the limit"),
    ('"\\u001b[2J" = 1\n' + BASE, r"\x1b[2J: unknown key"),
    (BASE + '\n[case."\\u001b[2J"]\nsecondary = "all"\ngraph = "full"\n', r"\x1b[2J"),
    (BASE.replace('"13-152"', '"\\u001b[2J"'), r'no switch "\x1b[2J"'),
    (BASE + "\nx = \x1b[31m\n", r"\x1b[31m"),
    (BASE.replace('"microgrid123"', f'"{"a" * 300}"'), "no such feeder"),
    (LINK + 'delay = { model = "trace", file = "/dev/zero" }\n', "there is no file"),
])  # fmt: skip
def test_a_hostile_file_is_refused_in_lines_that_can_be_printed(tmp_path: Path, text: str, said: str) -> None:
    """No file causes a traceback or a hang, or writes control characters to a terminal."""
    found = problems(tmp_path, text)
    assert any(said in line for line in found)
    assert all(line.isprintable() for line in found)
