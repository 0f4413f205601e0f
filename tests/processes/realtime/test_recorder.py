"""The command that records a run: it stands still for longer than Zenoh's lease, or its disk takes no more."""

from __future__ import annotations

import json
import os
import signal
from pathlib import Path
from time import monotonic, sleep

import pytest

from gridpeers.scenarios.record.record_reader import RunRecord
from tests.processes.terminals import Desk, children_of, wait_for

SCENARIO = """
[time]
end_s = 8.0
[[event]]
label = "early"
t_s = 0.2
open = ["60-160"]
[[event]]
label = "late"
t_s = 7.0
open = ["13-152"]
[case.IV]
secondary = "all"
graph = "full"
without_agent = ["inv4", "inv5", "inv6", "inv7", "inv8", "inv9"]
"""

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds the children in /proc")


def test_a_recorder_that_stood_still_has_every_row(desk: Desk) -> None:
    """SIGSTOP until the plant has lost it, then SIGCONT: it comes back and gets all that it has missed.

    Meanwhile inv3 was frozen for less than the lease, and has kept its token: the report says it, and both ends
    are told.
    """
    (desk.folder / "late.toml").write_text(SCENARIO)
    here, log = desk.folder / "here", desk.folder / "here" / "log" / "plant.log"
    words = ("up", "late.toml", "--for", "60", "--run", "lab")
    command = desk.open_bare(*words, "--listen", desk.options[-1], "--out", "here")
    wait_for(log, "t = 0; speed 1")
    (inv3,) = [pid for pid in children_of(command.pid) if Path(f"/proc/{pid}/cmdline").read_text().endswith("inv3\0")]

    os.kill(command.pid, signal.SIGSTOP)
    os.kill(inv3, signal.SIGSTOP)
    wait_for(log, "inv3 is silent: no state for 0.25 s, nothing comes from it")
    os.kill(inv3, signal.SIGCONT)
    wait_for(log, "inv3 is heard again")
    wait_for(log, "is out of reach; what it misses is kept for a while")
    os.kill(command.pid, signal.SIGCONT)
    wait_for(log, "is back")
    deadline = monotonic() + 60.0
    while RunRecord.open(here / "IV").t_end < 8.0:  # the recorder may be back later than the scenario's end
        assert monotonic() < deadline
        sleep(0.1)
    assert desk.type("down")[0] == 0

    assert command.end() == 0, command.text
    assert (here / "status.txt").read_text() == "complete\n"
    times = [float(line.split(",")[0]) for line in (here / "IV" / "history.csv").read_text().splitlines()[1:]]
    assert times == pytest.approx([0.01 * k for k in range(len(times))])
    assert times[-1] >= 8.0
    command.expect(r"NOTE  case IV: agents came, left or were silent \d+ times after .*, first: inv3 is silent")
    case = json.loads((here / "metrics.json").read_text())["cases"]["IV"]
    assert "missing" not in case
    measured = case["late"]
    assert (measured["f_error_Hz"] is None) == ("f_error_Hz" in measured.get("reasons", {}))
