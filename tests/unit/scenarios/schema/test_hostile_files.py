"""Damaged or hostile scenario and feeder files are refused in lines that can be printed."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridpeers.cli.usage import fail
from gridpeers.scenarios.catalogue_files import CATALOGUE
from gridpeers.scenarios.schema import load_scenario
from tests.scenario_files import problems, written

BASE = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
LINK = BASE + '\n[[link]]\non = "inv1 -> inv2"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BASE + "\nx = " + "[" * 5000, "nested too deeply"),
        (BASE + "\nx = " + "{a=" * 3000, "nested too deeply"),
        (BASE.replace("seed = 1 ", f"seed = {'1' * 5000} "), "a whole number has thousands of digits"),
        (BASE.replace("seed = 1 ", f"seed = {'1' * 400} "), "must be a finite number, got inf"),
        ('"a[b" = 1\n' + BASE, "a[b: unknown key"),
        ('"a." = 1\n' + BASE, "a.: unknown key"),
        ('"\\u001b[2J" = 1\n' + BASE, r"\x1b[2J: unknown key"),
        (BASE + '\n[case."\\u001b[2J"]\nsecondary = "all"\ngraph = "full"\n', r"\x1b[2J"),
        (BASE.replace('"13-152"', '"\\u001b[2J"'), r'no switch "\x1b[2J"'),
        (BASE + "\nx = \x1b[31m\n", r"\x1b[31m"),
        (BASE + "\nx = \u202e\n", r"\x202e"),
        (BASE + '\n[protection]\ntrips = { "\\u001b" = [1, 1] }\n', r'no trip function "\x1b"'),
        (BASE.replace('"microgrid123"', f'"{"a" * 300}"'), "no such feeder"),
        (
            LINK + 'delay = { model = "trace", file = "a\\u0000b" }\n',
            "file: has characters that cannot be printed",
        ),
        (LINK + 'delay = { model = "trace", file = "/dev/zero" }\n', "it is no file"),
        (LINK + 'loss = { model = "markov", p13 = 1.0, p31 = 1e-320 }\n', "p31 is a probability above 0"),
    ],
)
def test_a_hostile_file_is_refused_in_lines_that_can_be_printed(tmp_path: Path, text: str, said: str) -> None:
    """No file ends in a traceback or a hang, and none writes to a terminal what it likes."""
    found = problems(tmp_path, text)
    assert any(said in line for line in found)
    assert all(line.isprintable() for line in found)


def test_a_scenario_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    """Editors that put one there save a scenario as good as any; feeders' tables may have it too."""
    scenario, _ = load_scenario(written(tmp_path, "\ufeff" + BASE))
    assert list(scenario.cases) == ["I", "II", "III", "IV"]


def test_the_last_line_of_a_command_is_printable(capsys: pytest.CaptureFixture[str]) -> None:
    """No text that an error quotes can clear the screen; a message of several lines stays one."""
    with pytest.raises(SystemExit):
        fail(['no "\x1b[2J"\nas said'], 2)
    assert capsys.readouterr().err == 'gridpeers: no "\\x1b[2J"\nas said\n'


def test_a_first_voltage_beyond_the_bounds_of_set_points_is_refused(tmp_path: Path) -> None:
    """It would be held at the start only: the first word of an agent would move the voltage without an event."""
    found = problems(tmp_path, BASE + "\n[plant.gfl]\nV_set_min_pu = 1.01\n")

    assert [line.partition(": ")[2][:60] for line in found] == [
        "plant.V_set0_pu: 1 pu is beyond plant.gfl.V_set_min_pu = 1.01"[:60]
    ]
