"""The parts that docs/plugins.md shows work as they stand there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.scenarios.catalogue_files import CATALOGUE
from tests.command_line import invoke

PAGE = (Path(__file__).parents[3] / "docs" / "plugins.md").read_text(encoding="utf-8")
ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")


def block(language: str, number: int = 0) -> str:
    """A block of the page in a language."""
    return str(re.findall(rf"```{language}\n(.*?)```", PAGE, re.S)[number])


@pytest.mark.usefixtures("elsewhere")
def test_each_part_of_the_page_has_its_say_in_a_run(elsewhere: Path) -> None:
    """The module and the scenario of the page beside each other: metric, claim and check judge, the fault drops."""
    own = block("toml")
    top, case = own[: own.index("[case.IV]")], own[own.index("[case.IV]") :]
    until_case = ISLANDING.partition('[[event]]\nlabel = "event2"')[0].replace('paper = "islanding"', "")
    (elsewhere / "mine.py").write_text(block("python"), encoding="utf-8")
    text = f"{top}\n{until_case.replace('end_s = 7.0', 'end_s = 2.0')}\n{case}"
    (elsewhere / "mine.toml").write_text(text, encoding="utf-8")

    code, text = invoke("run", "mine.toml", "--driver", "inprocess", "--out", "here")

    assert code in (0, 1), text  # 1 says that the claim fails in so short a run
    assert re.search(r"(PASS|FAIL) .*Frequency and sharing are back within 1 s", text), text
    assert "f_min_Hz" in text
    (nadir,) = [it for it in gp.read("here").check_verdicts if it.check == "Nadir"]
    assert nadir.status == "passed", nadir.sentence
    assert ",fault" in (elsewhere / "here" / "IV" / "links.csv").read_text(encoding="utf-8")


def test_a_distribution_brings_a_command_a_reader_of_feeders_and_a_simulator(tmp_path: Path) -> None:
    """The module and the entry points of the page, as pip would install them."""
    (tmp_path / "mine.py").write_text(block("python", 1), encoding="utf-8")
    (tmp_path / "x.copy").write_text("ieee34\n", encoding="ascii")
    about = tmp_path / "mine-1.0.dist-info"
    about.mkdir()
    project = tomllib.loads(block("toml", 1))["project"]
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    points = [
        line for group, of in project["entry-points"].items() for line in (f"[{group}]", *map(" = ".join, of.items()))
    ]
    (about / "entry_points.txt").write_text("\n".join(points))

    def gridpeers(*words: str) -> str:
        command = [sys.executable, "-m", "gridpeers", *words]
        env = os.environ | {"PYTHONPATH": str(tmp_path)}
        done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
        assert done.returncode in (0, 1), done.stderr  # 1 says that a claim fails with other sensors
        return done.stdout

    assert gridpeers("feeder", "import", "x.copy", "--out", "y").startswith("ieee34: ")
    gridpeers("run", "islanding", "--case", "IV", "--plant", "biased", "--driver", "inprocess", "--out", "here")
    frequencies = [float(line.split()[1]) for line in gridpeers("nadir", "here").splitlines()[1:]]
    assert len(frequencies) == 9
    assert all(59.0 < f < 60.0 for f in frequencies)
