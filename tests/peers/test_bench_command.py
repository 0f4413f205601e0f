"""The command `python -m bench.peers`: what is measured is kept, and a failure is a line, no traceback."""

import json
from pathlib import Path
from typing import NoReturn

import pytest
from typer.testing import CliRunner

from bench.peers.__main__ import app
from bench.peers.measured import Measure
from bench.peers.parts import PARTS, SHORT, Extent


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two parts that take no time: one is measured, one fails before its first measure."""

    def measured(extent: Extent) -> list[Measure]:
        return [Measure("both", lambda: {"ours.tick.9": 0.002, "zenoh.tick.9": 0.001})]

    def fails(extent: Extent) -> NoReturn:
        raise RuntimeError("no feeder")

    monkeypatch.setitem(PARTS, "tick", measured)
    monkeypatch.setitem(PARTS, "plant", fails)


@pytest.mark.usefixtures("parts")
def test_a_part_that_fails_is_a_line_and_exit_code_1_and_the_others_are_kept(tmp_path: Path) -> None:
    """Part, measure and reason stand in one line; numbers and ratios of the others are printed and written."""
    file = tmp_path / "measured.json"

    done = CliRunner().invoke(app, ["plant", "tick", "--json", str(file)])

    assert done.exit_code == 1
    assert done.stderr.splitlines()[-1] == "plant: all of it: no feeder"
    assert "| a tick, a process for each agent: bare Zenoh, empty | 1 | 2 | 0.5 | 0.5 | 0.5 | 5 |" in done.stdout
    assert json.loads(file.read_text())["tick"]["values"]["ours.tick.9"] == [0.002] * 5


def test_a_part_that_is_unknown_is_told_with_those_that_there_are() -> None:
    """The line says what is wrong and what would be right."""
    done = CliRunner().invoke(app, ["ticks"], terminal_width=200)

    assert done.exit_code == 2
    assert 'part "ticks": there is no such part; choose from plant, case' in done.stderr


@pytest.mark.parametrize("name", ["command", "scale"])
def test_the_real_measures_of_a_part_give_values(name: str) -> None:
    """As short as can be: none fails."""
    for measure in PARTS[name](SHORT):
        assert measure.run()
