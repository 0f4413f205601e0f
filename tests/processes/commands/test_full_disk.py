"""A disk that takes no more: /dev/full for what is printed, a limit on the size of files for what is written."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.processes.commands.test_run_command import SHORT, command
from tests.processes.terminals import DEADLINE, LIMITED

FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize(
    "words",
    [
        command("--help"),
        command("run", "calm.toml", "--driver", "inprocess", "--out", "here"),
    ],
    ids=["help", "run"],
)
def test_output_that_cannot_be_written_is_told_in_one_line(words: list[str], tmp_path: Path) -> None:
    """Exit status 2, what could not be written and why, no traceback; a run's folder says why it is not whole."""
    (tmp_path / "calm.toml").write_text('[time]\nend_s = 0.1\n[case.calm]\nsecondary = "all"\ngraph = "ring"\n')
    with FULL.open("w") as full:
        done = subprocess.run(
            words,
            cwd=tmp_path,
            stdin=subprocess.DEVNULL,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=DEADLINE,
        )

    said = "standard output cannot be written: No space left on device"
    assert (done.returncode, done.stderr) == (2, f"gridpeers: {said}\n")
    if "run" in words:
        assert (tmp_path / "here" / "status.txt").read_text() == f"broken: {said}\n"


@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
def test_a_complaint_that_cannot_be_written_keeps_its_exit_status(tmp_path: Path) -> None:
    """A script that looks at exit statuses learns what was wrong even with standard error on a full disk."""
    with FULL.open("w") as full:
        done = subprocess.run(
            command("run", "nowhere.toml", "--speed", "2"), cwd=tmp_path, stderr=full, timeout=DEADLINE
        )

    assert done.returncode == 2


def test_a_run_without_room_for_its_record_breaks_in_one_line(tmp_path: Path) -> None:
    """Exit status 3; the history keeps its partial name, and nothing in the folder claims to be whole."""
    (tmp_path / "long.toml").write_text(SHORT.replace("end_s = 1.5", "end_s = 7.0"))
    done = subprocess.run(
        [*LIMITED, *command("run", "long.toml", "--driver", "inprocess", "--out", "here")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=100,
    )

    why = "here: cannot be written: File too large"
    assert done.returncode == 3
    assert done.stderr == f"gridpeers: the run broke: {why}\ngridpeers: what came until then is in here/\n"
    here = tmp_path / "here"
    assert (here / "status.txt").read_text() == f"broken: {why}\n"
    assert sorted(path.name for path in here.iterdir()) == ["IV", "log", "scenario.toml", "status.txt"]
    assert not (here / "IV" / "history.csv").exists()
