"""The command `python -m bench.peers`: what is measured is kept, and a failure is a line, no traceback."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import NoReturn

import pytest
from typer.testing import CliRunner

from bench.harness import GRIDPEERS, checked, reason
from bench.peers import our_case
from bench.peers.__main__ import app
from bench.peers.measured import Measure, measure_in_turns
from bench.peers.mesh import full_graph, seconds_per_round
from bench.peers.parts import PACKAGE, PARTS, SHORT, Extent


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


COMMAND = """
import sys
from pathlib import Path
if "--out" in sys.argv:
    case = Path(sys.argv[-1], "IV")
    case.mkdir(parents=True)
    (case / "history.csv").write_text("t_s")
"""
"""Stands for the command `gridpeers run`, of which nothing is measured but when its files come."""


def test_the_real_measures_of_a_part_give_values(monkeypatch: pytest.MonkeyPatch) -> None:
    """As short as can be: none fails."""
    monkeypatch.setattr(our_case, "GRIDPEERS", [sys.executable, "-c", COMMAND])

    for measure in PARTS["command"](SHORT):
        assert measure.run()


def fails() -> dict[str, float]:
    """Fail as a rival does whose broker has died."""
    raise ValueError("no broker\nat line 3\nbroker.log: no room")


def test_a_rival_without_its_package_or_that_fails_is_left_out_and_named() -> None:
    """The others are measured all the same, in every round."""
    measures = [
        Measure("ours", lambda: {"ours": 2.0}),
        Measure("theirs", lambda: {"theirs": 1.0}, "no-such-rival"),
        Measure("broken", fails),
    ]

    part = measure_in_turns(lambda: measures, rounds=3)

    assert part.values == {"ours": [2.0] * 3}
    assert part.left_out["theirs"] == "no-such-rival is not installed: pip install 'gridpeers[bench]'"
    assert part.left_out["broken"] == "ValueError: no broker ... broker.log: no room"
    assert part.failed
    assert len(part.loads) == 4


def test_a_command_that_fails_is_named_as_a_person_types_it_with_its_last_line() -> None:
    """One line says which command, its exit status, and what it said last."""
    with pytest.raises(subprocess.CalledProcessError) as caught:
        checked([*GRIDPEERS, "run", "no-such-scenario"])

    line = reason(caught.value)

    assert line.startswith("`gridpeers run no-such-scenario` ended with 2: ")
    assert "\n" not in line


@pytest.mark.parametrize("transport", PACKAGE)
def test_every_rival_does_the_rounds_of_a_mesh(transport: str) -> None:
    """Hub and agents meet, exchange all messages of some rounds, and end by themselves."""
    if PACKAGE[transport]:
        pytest.importorskip({"pyzmq": "zmq"}.get(PACKAGE[transport], PACKAGE[transport]))

    assert 0.0 < seconds_per_round(transport, full_graph(["a", "b"]), rounds=3, sizes=(200, 100)) < 10.0
