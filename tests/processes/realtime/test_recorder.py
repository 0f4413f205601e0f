"""The command that records a run stands still, a process is killed, or the disk takes no more: what came is there."""

from __future__ import annotations

import json
import os
import resource
import signal
from pathlib import Path
from time import monotonic, sleep

import pytest

from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke
from tests.processes.terminals import Desk, children_of, wait_for
from tests.record.killed_commands import CLOCKS, Clock, assert_commands_read, assert_usable, killed

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
    command.expect(r"NOTE  case IV: agents joined, left or were silent \d+ times")
    case = json.loads((here / "metrics.json").read_text())["cases"]["IV"]
    assert "missing" not in case
    measured = case["late"]
    assert (measured["f_error_Hz"] is None) == ("f_error_Hz" in measured.get("reasons", {}))


MOST = 4.0  # Run time (s) of a run beyond which it would take long to read


@pytest.mark.parametrize(("who", "clock"), [("plant", "realtime"), ("inv1", "simulated")])
def test_a_killed_process_leaves_a_record(who: str, clock: Clock, tmp_path: Path) -> None:
    """Every recorded decision can be made again, whichever process was killed."""
    assert_usable(killed(tmp_path / "run", clock, 1.3, who, most=MOST), complete=who == "plant")


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_killed_command_leaves_a_record(clock: Clock, tmp_path: Path) -> None:
    """It opens, lacks at most the last second, and every command that reads a record works on it."""
    left = killed(tmp_path / "run", clock, 0.6, most=MOST)

    assert_usable(left)
    if clock == "realtime":
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

ROOM = 180_000  # Greatest size (bytes) of any file of a run, which its record reaches after some seconds


@pytest.mark.parametrize(("words", "said"), [
    (("run", "--clock", "realtime"), "here/calm/run.mcap: cannot be written: File too large"),
    (("up", "--run", "full", "--for", "7", "--listen", "tcp/127.0.0.1:0"), "s: File too large"),
])  # fmt: skip
def test_a_run_without_room_for_its_record_ends_and_has_what_came_until_then(
    words: tuple[str, ...], said: str, elsewhere: Path
) -> None:
    """Its last line names the reason, no file is empty, and the record can be read."""
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
