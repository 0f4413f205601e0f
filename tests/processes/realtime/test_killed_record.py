"""A process of a recorded run is killed, or its disk is full: the record opens and has what came before."""

from __future__ import annotations

import resource
from pathlib import Path

import pytest

from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke
from tests.record.killed_commands import CLOCKS, Clock, assert_commands_read, assert_usable, killed

MOST = 4.0
"""Run time (s) of a run beyond which it would take long to read."""


@pytest.mark.parametrize(("who", "clock"), [("plant", "wall"), ("inv1", "simulated")])
def test_a_killed_process_leaves_a_record(who: str, clock: Clock, tmp_path: Path) -> None:
    """Decisions are made again from all that is there, if what it records was killed."""
    assert_usable(killed(tmp_path / "run", clock, 1.3, who, most=MOST), complete=who == "plant")


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_killed_command_leaves_a_record(clock: Clock, tmp_path: Path) -> None:
    """It opens, lacks at most the last second, and every command that reads a record works on it."""
    left = killed(tmp_path / "run", clock, 0.6, most=MOST)

    assert_usable(left)
    if clock == "wall":
        assert_commands_read(left.record)


CALM = """
[time]
end_s = 7.0
record_s = 0.02
[[event]]
label = "islanding"
t_s = 0.5
open = ["13-152"]
[case.calm]
secondary = "all"
graph = "full"
without_agent = ["inv3", "inv5", "inv6", "inv8", "inv9"]
"""

ROOM = 180_000
"""Greatest size (bytes) of any file of a run, which its record reaches after some seconds."""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("run", "--clock", "wall"), "here/calm/run.mcap: cannot be written: File too large"),
        (("up", "--run", "full", "--for", "7", "--listen", "tcp/127.0.0.1:0"), "s: File too large"),
    ],
)
def test_a_run_without_room_for_its_record_ends_and_has_what_came_until_then(
    words: tuple[str, ...], said: str, elsewhere: Path
) -> None:
    """Its last words name the reason, no file is empty, and what is in the record can be read."""
    (elsewhere / "calm.toml").write_text(CALM)
    command, *options = words
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, unlimited[1]))
    try:
        code, text = invoke(command, "calm.toml", *options, "--out", "here")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)

    here = elsewhere / "here"
    assert code == 3, text
    assert "Traceback" not in text
    status = (here / "status.txt").read_text()
    assert (status.startswith("broken: "), status.endswith(f"{said}\n")) == (True, True), status
    assert [file for file in here.rglob("*.*") if file.suffix != ".log" and not file.stat().st_size] == []
    record = RunRecord.open(here / "calm")
    assert 1.0 < record.t_end < 6.9
    assert any("cut off" in text for text in record.damage)
    assert record.decision("inv4", record.t_end - 0.5).action == "law"
