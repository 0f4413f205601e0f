"""`gridpeers predict`: words, widths, exit codes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gridpeers.scenarios.catalogue_files import CATALOGUE
from tests.command_line import invoke

ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
APART = """
[case.apart]
title = "three islands of talk"
secondary = "all"
graph = "links"
links = [["inv1", "inv2"], ["inv2", "inv3"], ["inv4", "inv5"], ["inv5", "inv6"], ["inv8", "inv9"]]
"""


pytestmark = pytest.mark.usefixtures("elsewhere")


def test_every_case_is_printed_within_a_hundred_columns_and_without_nan(elsewhere: Path) -> None:
    """The paper's cases and an unconnected graph; words replace missing numbers."""
    (elsewhere / "mine.toml").write_text(ISLANDING.replace('paper = "islanding"', "") + APART)

    code, text = invoke("predict", "mine.toml")

    blocks = dict(re.findall(r"^islanding, case (\w+) (.*?)(?=\n\n|\Z)", text, flags=re.S | re.M))
    assert code == 0
    assert max(map(len, text.splitlines())) <= 100
    assert not re.search(r"\b(nan|inf)\b", text)
    assert "No secondary control" in blocks["I"]
    assert "their limit is 1.00 pu" in blocks["II"]
    assert "The other 6 with an agent" in " ".join(blocks["III"].split())
    assert "restored in 0.64 s" in blocks["IV"]
    assert "its 4 parts (inv1 inv2 inv3 | inv4 inv5 inv6 | inv7 | inv8 inv9)" in " ".join(blocks["apart"].split())
    assert re.search(r"sharing 2 % +never", blocks["apart"])


def test_leave_and_return_are_predicted() -> None:
    """Plug-n-play: both events restored, the return without a step of the load."""
    code, text = invoke("predict", "plug-n-play", "--case", "IV", "--no-vars")

    words = " ".join(text.split())
    assert code == 0
    assert re.search(r"leave at 2 s: load 0\.873 -> 0\.959 pu of the ratings: restored in 0\.3\d s", words)
    assert re.search(r"return at 3 s: load 0\.959 -> 0\.873 pu of the ratings: restored in 0\.\d\d s", words)
    assert "left out (--no-vars)" in words


@pytest.mark.parametrize(("words", "said"), [
    (["predict", "islanding", "--case", "V"], '--case: no case "V"; did you mean "IV"?'),
    (["predict", "bad.toml"], "bad.toml:15: time.T_c_s: 20 s is not plausible"),
])  # fmt: skip
def test_bad_input_is_refused_as_by_the_other_commands(elsewhere: Path, words: list[str], said: str) -> None:
    """Exit code 2 and a line with the remedy."""
    (elsewhere / "bad.toml").write_text(ISLANDING.replace("T_c_s = 0.02", "T_c_s = 20"))

    code, text = invoke(*words)

    assert code == 2
    assert said in text
