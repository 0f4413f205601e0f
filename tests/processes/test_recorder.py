"""The command that records a run stands still for longer than Zenoh's lease: the run goes on, the record is whole."""

from __future__ import annotations

import json
import os
import signal

import pytest

from tests.processes.terminals import Desk, wait_for

SCENARIO = """
[time]
end_s = 14.0
[[event]]
label = "late"
t_s = 13.0
open = ["13-152"]
[case.IV]
secondary = "all"
graph = "full"
"""


@pytest.mark.parametrize(
    ("words", "log"),
    [
        (("up", "late.toml", "--for", "14", "--run", "lab", "--speed", "2"), "log/plant.log"),
        (("run", "late.toml", "--clock", "wall", "--speed", "2"), "log/IV/plant.log"),
    ],
    ids=["up", "run"],
)
def test_a_recorder_that_stood_still_has_every_row(desk: Desk, words: tuple[str, ...], log: str) -> None:
    """SIGSTOP until the plant has lost it, then SIGCONT: it comes back and gets all that it has missed."""
    (desk.folder / "late.toml").write_text(SCENARIO)
    here = desk.folder / "here"
    listen = ("--listen", desk.options[-1]) if words[0] == "up" else ()
    command = desk.open_bare(*words, *listen, "--out", "here")
    wait_for(here / log, "t = 0; speed 2")

    os.kill(command.pid, signal.SIGSTOP)
    wait_for(here / log, "is out of reach; what it misses is kept for a while")
    os.kill(command.pid, signal.SIGCONT)
    wait_for(here / log, "is back")

    assert command.end() == 0, command.text
    assert (here / "status.txt").read_text() == "complete\n"
    times = [float(line.split(",")[0]) for line in (here / "IV" / "history.csv").read_text().splitlines()[1:]]
    assert times == pytest.approx([0.01 * k for k in range(1401)])
    metrics = json.loads((here / "metrics.json").read_text())
    assert "missing" not in metrics.get("by_hand", {})
    measured = metrics["cases"]["IV"]["late"]
    assert (measured["f_error_Hz"] is None) == ("f_error_Hz" in measured.get("reasons", {}))
