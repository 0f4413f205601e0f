"""A process of a recorded run is killed, or its disk is full: the record opens and has what came before."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest

from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke
from tests.record.full_disk import CALM, has_namespaces
from tests.record.killed_commands import CLOCKS, Clock, assert_usable, killed
from tests.record.reader_commands import assert_commands_read

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


@pytest.mark.skipif(not has_namespaces(), reason="no file system can be mounted in a namespace of its own here")
def test_on_a_full_disk_a_record_ends_and_is_read() -> None:
    """On a small disk that is filled under way a live run breaks, says so once, and leaves no empty file."""
    command = [sys.executable, "-m", "tests.record.full_disk", "live"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=250)

    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("and is read") == 1


ROOM = 180_000
"""Greatest size (bytes) of any file of a run, which its record reaches after some seconds."""


def test_a_run_without_room_for_its_record_breaks_and_has_what_came_until_then(elsewhere: Path) -> None:
    """Its last words name the file and the reason, and what is in it can be read."""
    (elsewhere / "calm.toml").write_text(CALM)
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, unlimited[1]))
    try:
        code, text = invoke("run", "calm.toml", "--clock", "wall", "--out", "here")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)

    here = elsewhere / "here"
    assert code == 3, text
    assert (here / "status.txt").read_text() == "broken: here/calm/run.mcap: cannot be written: File too large\n"
    record = RunRecord.open(here / "calm")
    assert 1.0 < record.t_end < 6.9
    assert any("cut off" in text for text in record.damage)
    assert record.decision("inv4", record.t_end - 0.5).action == "law"
