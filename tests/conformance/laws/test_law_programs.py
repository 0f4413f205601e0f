"""The complete programs of docs/how-to/law-programs.md: the paper's law in C and in Python, without gridpeers."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gridpeers.agents.laws.consensus import Consensus
from gridpeers.agents.laws.law import Neighbour, Own
from tests.conformance.laws.law_runs import islanding, written
from tests.conformance.laws.test_carriers import PATIENT

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples" / "law-program"
PAGE = (ROOT / "docs" / "how-to" / "law-programs.md").read_text()
PYTHON = (sys.executable, str(EXAMPLES / "paper_law.py"))


@pytest.fixture(scope="module")
def in_c(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """The program in C, built as the page says, with all warnings as errors."""
    cc = shutil.which("cc")
    if cc is None:
        pytest.skip("no C compiler is here")
    program = tmp_path_factory.mktemp("law") / "law"
    options = re.search(r"^\$ cc (.*) paper_law\.c -o law -lm$", PAGE, re.MULTILINE)
    assert options is not None
    source = str(EXAMPLES / "paper_law.c")
    subprocess.run(
        [cc, *options[1].split(), "-Wall", "-Wextra", "-Werror", source, "-o", str(program), "-lm"], check=True
    )
    return (str(program),)


@pytest.fixture(params=["C", "Python"])
def command(request: pytest.FixtureRequest) -> tuple[str, ...]:
    return PYTHON if request.param == "Python" else request.getfixturevalue("in_c")


def answers(command: tuple[str, ...], *lines: str) -> list[dict[str, object]]:
    done = subprocess.run(command, input="".join(f"{line}\n" for line in lines), capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_the_program_in_python_gives_the_history_of_the_class() -> None:
    """To the byte."""
    assert written({"command": list(PYTHON), "k_p": 0.0007, **PATIENT}).sha256 == islanding(short=True).sha256


def test_the_program_in_c_gives_the_history_of_the_class(in_c: tuple[str, ...]) -> None:
    """To the byte, in ten processes."""
    law = {"command": list(in_c), "k_p": 0.0007, **PATIENT}
    assert written(law, driver="processes").sha256 == islanding(short=True).sha256


def test_the_programs_answer_the_pages_lines_as_the_page_does(command: tuple[str, ...]) -> None:
    """The lines have every field."""
    start, ready, step, decision = re.findall(r"```json\n(.*)\n```", PAGE)

    asked = json.loads(step)
    law = Consensus(**json.loads(start)["parameters"])
    decided = law.step(Own(**asked["own"]), [Neighbour(**other) for other in asked["neighbours"]], asked["T"])

    assert answers(command, start, step) == [json.loads(ready), json.loads(decision)]
    assert {"P_set": decided.P_set, "V_set": decided.V_set} == json.loads(decision)
    assert tuple(json.loads(start)["own"]) == tuple(json.loads(step)["own"]) == Own._fields
    assert tuple(json.loads(step)["neighbours"][0]) == Neighbour._fields


def test_a_program_begins_anew_with_other_parameters(command: tuple[str, ...]) -> None:
    """A second start takes back the parameters of the first; kappa_c and limits count."""
    start, _, step, decision = re.findall(r"```json\n(.*)\n```", PAGE)
    asked = json.loads(start)
    other = json.dumps(asked | {"parameters": {"P_set_max": 0.65, "kappa_c": 12.0, "V_full": 0.02}})
    _, limited, _, again = answers(command, other, step, start, step)

    assert limited["P_set"] == 0.65
    assert limited["V_set"] != json.loads(decision)["V_set"]
    assert again == json.loads(decision)


def test_a_line_without_numbers_is_an_error(in_c: tuple[str, ...]) -> None:
    """The program in C, with a JSON reader of its own, answers nonsense with an error and continues."""
    start, _, step, decision = re.findall(r"```json\n(.*)\n```", PAGE)
    odd = ['{"type":"step"}', '{"type":"step","own":{"P_set":"x"},"neighbours":[{}]}', "[", '{"a', "{}", ""]
    got = answers(in_c, start, *odd, step)

    assert [sorted(answer) for answer in got[1:-1]] == [["error"]] * len(odd)
    assert got[-1] == json.loads(decision)
