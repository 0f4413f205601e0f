"""A disk that takes no more: /dev/full for what is printed, a limit on the size of files for what is written."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes.terminals import DEADLINE, Desk
from tests.processes.test_command import SHORT, command

FULL = Path("/dev/full")

LIMIT = 512 * 1024
"""Greatest size (bytes) of any file: the plant's compiled loop fits, the history of 7 s does not."""

LIMITED = [
    *(sys.executable, "-c"),
    "import os, resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2);"
    "os.execvp(sys.argv[2], sys.argv[2:])",
    str(LIMIT),
]
"""Before a command, in whose files there is no more room."""


@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize(
    "words",
    [
        command("list"),
        command("doc", "keys"),
        command("--help"),
        command("run", "calm.toml", "--driver", "inprocess", "--out", "here"),
        [sys.executable, "-m", "netem.tc"],
        [sys.executable, "-m", "netem.relay", "tcp/127.0.0.1:0", "tcp/127.0.0.1:1"],
    ],
    ids=["list", "doc", "help", "run", "netem.tc", "netem.relay"],
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
    program = words[2] if words[1] == "-m" else "gridpeers"
    assert (done.returncode, done.stderr) == (2, f"{program}: {said}\n")
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


@pytest.mark.parametrize("driver", ["inprocess", "processes"])
def test_a_run_without_room_for_its_record_breaks_in_one_line(driver: str, tmp_path: Path) -> None:
    """Exit status 3; the history keeps its partial name, and nothing in the folder claims to be whole."""
    (tmp_path / "long.toml").write_text(SHORT.replace("end_s = 1.5", "end_s = 7.0"))
    done = subprocess.run(
        [*LIMITED, *command("run", "long.toml", "--driver", driver, "--out", "here")],
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


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the children in /proc")
def test_a_run_by_hand_goes_on_without_its_record_and_says_so(desk: Desk) -> None:
    """At once: from when on and why. What happens is told to the end; then exit status 3, and no process left."""
    (desk.folder / "late.toml").write_text(
        '[time]\nend_s = 60.0\n[[event]]\nlabel = "late"\nt_s = 30.0\nopen = ["13-152"]\n'
        '[case.calm]\nsecondary = "all"\ngraph = "ring"\n'
    )
    words = ("up", "late.toml", "--run", "lab", "--listen", desk.options[-1], "--out", "here")
    up = desk.open_bare(*words, "--speed", "10", "--for", "40", prefix=LIMITED)
    for _ in range(9):
        up.expect("inv[1-9] joined")
    children = [int(pid) for pid in Path(f"/proc/{up.pid}/task/{up.pid}/children").read_text().split()]
    stopped = float(up.expect(r"the record ends at (.*) s: File too large; the run goes on without it")[1])
    up.expect(r"30\.00 s  switch 13-152 opened")

    assert up.end() == 3
    assert "Traceback" not in up.text
    assert re.search(r"ended at t = 40\.00 s; \d+ of 2000 steps", up.text)
    assert 0.0 < stopped < 40.0
    why = up.expect(r"gridpeers: (the record ends at .* s: File too large)")[1]
    assert (desk.folder / "here" / "status.txt").read_text() == f"broken: {why}\n"
    assert len(children) == 10
    for child in children:
        with pytest.raises(ProcessLookupError):
            os.kill(child, 0)
