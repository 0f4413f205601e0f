"""The command with real processes: same bytes as without, and nothing left running when it is ended."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from gridpeers.scenarios.catalogue_files import CATALOGUE
from tests.command_line import invoke

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
        assert running.stdout is not None
        assert any(line.startswith("case long: ") for line in running.stdout)  # the second case is on its way now
        children = Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()
        running.send_signal(signal.SIGTERM)
        _, errors = running.communicate(timeout=60)

    assert running.returncode == 143, errors
    assert errors == "gridpeers: interrupted; what came until then is in here/\n"
    assert (tmp_path / "here" / "status.txt").read_text().startswith("broken: interrupted")
    for child in children:
        with pytest.raises(ProcessLookupError):
            os.kill(int(child), 0)
