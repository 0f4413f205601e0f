"""`gridpeers run` and `replay` as commands: their bytes, their end, a closed pipe, a full disk."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import gridpeers as gp
from gridpeers.scenarios.catalogue_files import CATALOGUE
from tests.command_line import invoke
from tests.processes.terminals import DEADLINE, children_of, wait_for, wait_for_the_end_of

ISLANDING = (CATALOGUE / "islanding.toml").read_text(encoding="utf-8")
HEAD = ISLANDING.replace('paper = "islanding"', "").partition('[[event]]\nlabel = "event2"')[0]
SHORT = HEAD.replace("end_s = 7.0", "end_s = 1.5") + ISLANDING[ISLANDING.index("[case.IV]") :]
"""Case IV, the first 1.5 s."""


def command(*words: str) -> list[str]:
    """The command line as a user's shell would start it."""
    return [sys.executable, "-c", "from gridpeers.cli.app import main; main()", *words]


def test_with_processes_the_command_gives_the_bytes_of_one_process(elsewhere: Path) -> None:
    """`--driver` decides how long a run takes, and nothing in metrics.json but its own name."""
    (elsewhere / "short.toml").write_text(SHORT)
    metrics = {}
    for driver in ("processes", "inprocess"):
        code, text = invoke("run", "short.toml", "--driver", driver, "--out", driver)
        assert code == 0, text
        metrics[driver] = json.loads((elsewhere / driver / "metrics.json").read_text())

    assert metrics["processes"].pop("driver") == "processes"
    assert metrics["inprocess"].pop("driver") == "inprocess"
    assert metrics["processes"] == metrics["inprocess"]
    assert {path.name for path in (elsewhere / "processes" / "log").iterdir()} == {"IV", "run.log"}
    assert len(list((elsewhere / "processes" / "log" / "IV").glob("*.log"))) == 10


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the children in /proc")
def test_an_ended_command_ends_its_processes(tmp_path: Path) -> None:
    """SIGTERM leaves no process, one line, and a folder that says what happened."""
    long = SHORT.replace("[case.IV]", "[case.long]") + "\n" + SHORT[SHORT.index("[case.IV]") :]
    (tmp_path / "two.toml").write_text(long.replace("[case.IV]", "[case.longer]"))

    with subprocess.Popen(
        command("run", "two.toml", "--out", "here"),
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as running:
        wait_for(tmp_path / "here" / "log" / "run.log", "case long: ")  # the second case is on its way now
        children = children_of(running.pid)
        running.send_signal(signal.SIGTERM)
        _, errors = running.communicate(timeout=60)

    assert running.returncode == 143, errors
    assert errors == "gridpeers: interrupted; what came until then is in here/\n"
    assert (tmp_path / "here" / "status.txt").read_text().startswith("broken: interrupted")
    wait_for_the_end_of(children)


def test_a_command_that_nobody_reads_ends_without_a_word() -> None:
    """Exit status 141, as of a command that SIGPIPE has ended."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(command("list"), stdout=writing, stderr=subprocess.PIPE, text=True, timeout=DEADLINE)
    finally:
        os.close(writing)

    assert (done.returncode, done.stderr) == (141, "")


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize(
    "words",
    [command("--help"), command("run", "calm.toml", "--driver", "inprocess", "--out", "here")],
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


HELD_FOR_A_WHILE = """
law = "held:Held"
[time]
end_s = 0.1
[[event]]
label = "islanding"
t_s = 0.04
open = ["13-152"]
[case.IV]
secondary = "all"
graph = "full"
"""

LAW = """
import os
import gridpeers as gp

class Held(gp.Law):
    def step(self, own, neighbours, T):
        if number := os.environ.get("SIGNAL_AT_STEP"):
            os.kill(os.getpid(), int(number))
        return gp.SetPoints(P_set=own.P_set, V_set=own.V_set)
"""
"""A law that sends its own process a signal, so that it comes in the middle of the work on every machine."""


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run with that law, which nobody stopped."""
    folder = tmp_path_factory.mktemp("held")
    (folder / "held.py").write_text(LAW, encoding="utf-8")
    (folder / "short.toml").write_text(HELD_FOR_A_WHILE, encoding="utf-8")
    return gp.load(folder / "short.toml").run("IV", folder=folder / "out").folder


def test_a_stopped_replay_ends_as_a_stopped_run(held: Path, tmp_path: Path) -> None:
    """One line, the exit code of the signal, a folder that says what happened, and no temporary ones."""
    (tmp_path / "tmp").mkdir()
    own = {"SIGNAL_AT_STEP": str(int(signal.SIGINT)), "TMPDIR": str(tmp_path / "tmp")}
    words = ("replay", str(held), "--without", "inv4 <-> inv7", "--out", "would")
    done = subprocess.run(
        command(*words), cwd=tmp_path, env=os.environ | own, capture_output=True, text=True, timeout=DEADLINE
    )

    assert (done.returncode, done.stderr) == (130, "gridpeers: interrupted; what came until then is in would/\n")
    assert not list((tmp_path / "tmp").iterdir())
    assert (tmp_path / "would" / "status.txt").read_text() == "broken: interrupted from the keyboard\n"
    assert (tmp_path / "would" / "IV" / "run.mcap").exists()
    assert not (tmp_path / "would" / "metrics.json").exists()
