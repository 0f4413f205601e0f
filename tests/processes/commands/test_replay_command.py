"""`gridpeers replay` as a process of its own, which a signal stops."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import gridpeers as gp

SHORT = """
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
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run with that law, which nobody stopped."""
    folder = tmp_path_factory.mktemp("held")
    (folder / "held.py").write_text(LAW, encoding="utf-8")
    (folder / "short.toml").write_text(SHORT, encoding="utf-8")
    return gp.load(folder / "short.toml").run("IV", folder=folder / "out").folder


@pytest.mark.parametrize(
    ("number", "words", "left"),
    [
        (signal.SIGINT, ("--without", "inv4 <-> inv7", "--out", "would"), "what came until then is in would/"),
        (signal.SIGTERM, (), "nothing was written"),
    ],
)
def test_a_stopped_replay_ends_as_a_stopped_run(
    number: signal.Signals, words: tuple[str, ...], left: str, run: Path, tmp_path: Path
) -> None:
    """One line, the exit code of the signal, a folder that says what happened, and no temporary ones."""
    (tmp_path / "tmp").mkdir()
    own = {"SIGNAL_AT_STEP": str(int(number)), "TMPDIR": str(tmp_path / "tmp")}

    done = subprocess.run(
        [sys.executable, "-P", "-m", "gridpeers", "replay", str(run), *words],
        cwd=tmp_path,
        env=os.environ | own,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )

    assert (done.returncode, done.stderr) == (128 + number, f"gridpeers: interrupted; {left}\n"), done.stdout
    assert not list((tmp_path / "tmp").iterdir())
    if words:
        by = "from the keyboard" if number == signal.SIGINT else "by SIGTERM"
        assert (tmp_path / "would" / "status.txt").read_text() == f"broken: interrupted {by}\n"
        assert (tmp_path / "would" / "IV" / "run.mcap").exists()
        assert not (tmp_path / "would" / "metrics.json").exists()
