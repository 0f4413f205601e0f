"""The parts that docs/plugins.md shows work as they stand there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.scenarios.catalogue_files import CATALOGUE
from tests.command_line import invoke

PAGE = (Path(__file__).parents[3] / "docs" / "plugins.md").read_text(encoding="utf-8")
ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")


def block(language: str) -> str:
    """The first block of the page in a language."""
    found = re.search(rf"```{language}\n(.*?)```", PAGE, re.S)
    assert found
    return found[1]


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
