"""Kill commands at random moments, see what their records lack, and read them by every command that reads a record.

python -m tests.record.killed_commands 20               so many runs of each clock
python -m tests.record.killed_commands 5 plant inv1     kills the plant, and an agent, instead of the command
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
from math import inf
from pathlib import Path
from time import monotonic, sleep
from typing import Literal, NamedTuple

from gridpeers.lab.replay.recomputation import recomputed
from gridpeers.scenarios.record.record_info import FILE
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.record import PARTIAL
from tests.record.reader_commands import assert_commands_read

LONG = """
[time]
end_s = 600.0
[[event]]
label = "event1"
t_s = 1.0
open = ["13-152"]
[case.IV]
secondary = "all"
graph = "full"
"""

LOSSY = """
[[link]]
on = "inv1 -> *"
loss = 0.1
"""

Clock = Literal["simulated", "one process", "wall"]

CLOCKS: tuple[Clock, ...] = ("simulated", "one process", "wall")
"""Kinds of runs: in simulated time with processes and without, and in wall-clock time."""

LATEST: dict[Clock, float] = {"simulated": 2.0, "one process": 0.6, "wall": 4.0}
"""Latest time (s) of a kill after the first row: some 30 s of run time, more of which would take minutes to be read."""


class Left(NamedTuple):
    """What a killed command has left behind."""

    record: RunRecord
    history: float
    """Last run time in the history (s)."""
    lost: float
    """Wall time (s) by which the record ends before the history, at the pace of the run."""


def killed(folder: Path, clock: Clock, after: float, who: str = "command", most: float = inf) -> Left:
    """Run a case until its first row is there, kill a process some time (s) later, and open what is left.

    With `most` (s of run time) it is killed earlier, once the run has come so far, as a busy machine may wake this
    process late; but not before its record has a chunk with rows.
    """
    folder.mkdir(parents=True)
    (folder / "long.toml").write_text(LONG + ("" if clock == "one process" else LOSSY), encoding="utf-8")
    pace = ("--driver", "inprocess") if clock == "one process" else ("--clock", clock)
    words = [sys.executable, "-m", "gridpeers", "run", "long.toml", *pace, "--out", "out"]
    command = subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    history = folder / "out" / "IV" / PARTIAL
    try:
        began = wait_for_rows(command, history)
        if most == inf:
            sleep(after)
        else:
            _wait_for_chunk(command, history, monotonic() + after, began[1] + most)
        process = command.pid if who == "command" else _process(command.pid, who)
        first, t = began
        os.kill(process, signal.SIGKILL)
        killed_at = monotonic()
        if who == "plant":  # the run breaks, and the command closes its files
            command.wait(60.0)
        elif who != "command":
            wait_for_rows(command, history, more=20_000)
    finally:
        command.kill()
        command.wait()
    last = _last_time(history)
    record = RunRecord.open(folder / "out" / "IV")
    speed = 1.0 if clock == "wall" else max((last - t) / (killed_at - first), 1e-9)
    lost = min(max(0.0, last - record.t_end) / speed, killed_at - first)  # a busy machine may let a run stand still
    return Left(record, last, lost)


def wait_for_rows(command: subprocess.Popen[bytes], history: Path, more: int = 5000) -> tuple[float, float]:
    """Wait for the first rows, or some bytes more of them; return when they came, and their run time."""
    deadline = monotonic() + 120.0
    more += history.stat().st_size if history.exists() else 0
    while monotonic() < deadline:
        assert command.poll() is None, "the command ended by itself"
        if history.exists() and history.stat().st_size > more:
            return monotonic(), _last_time(history)
        sleep(0.02)
    raise AssertionError("no rows within 120 s")


def _wait_for_chunk(command: subprocess.Popen[bytes], history: Path, until: float, t: float) -> None:
    """Wait until a time (s, monotonic), or a run time (s) if that comes earlier, and until the record has grown."""
    record = history.with_name(FILE)
    size, deadline = record.stat().st_size, monotonic() + 120.0
    while (monotonic() < until and _last_time(history) < t) or record.stat().st_size == size:
        assert command.poll() is None, "the command ended by itself"
        assert monotonic() < deadline, "the record has not grown within 120 s"
        sleep(0.02)


def _last_time(history: Path) -> float:
    rows = history.read_bytes().split(b"\n")
    return float(rows[-2].split(b",")[0])


def _process(parent: int, name: str) -> int:
    """Return the process of the run with a name, a child of the command."""
    words = ["pgrep", "-P", str(parent), "-f", "--", f"--leash {name}$"]
    return int(subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()[0])


def assert_usable(left: Left, *, complete: bool = False) -> None:
    """The record opens, lacks at most the last second, and decisions are made again from all that it has."""
    record = left.record
    assert record.complete == complete
    assert complete or any("cut off" in text for text in record.damage)
    assert left.lost <= 1.0, f"{left.lost:.2f} s lost: history to {left.history:.2f} s, record to {record.t_end:.2f} s"
    begun = record.t_end > 0.5  # in one process a second of run time passes before the first chunk: `lost` judges that
    assert not begun or len(record.physics().t) > 1
    for agent in record.agents[:2]:
        again = list(recomputed(record, agent))
        assert all(each.agrees for each in again)
        assert not begun or again


def main() -> None:
    """Kill as many runs of each clock as asked for, and tell the most that was lost."""
    draws = random.Random(15)
    whom = sys.argv[2:] or ["command"]
    lost: dict[Clock, list[float]] = {clock: [] for clock in CLOCKS}
    for number in range(int(sys.argv[1])):
        for clock in CLOCKS:
            after, who = draws.uniform(0.0, LATEST[clock]), whom[number % len(whom)]
            if clock == "one process" and who != "command":
                continue
            with tempfile.TemporaryDirectory() as folder:
                left = killed(Path(folder) / "run", clock, after, who)
                assert_usable(left, complete=who == "plant")
                assert_commands_read(left.record)
                ends = f"history to {left.history:.2f} s, record to {left.record.t_end:.2f} s: {left.lost:.2f} s lost"
                print(f"{number} {clock}: {who} killed after {after:.2f} s; {ends}", flush=True)
                lost[clock].append(left.lost)
    for clock, of in ((clock, of) for clock, of in lost.items() if of):
        load = os.getloadavg()[0]
        print(f"{clock}: {len(of)} records opened and were read; at most {max(of):.2f} s lost; load {load:.1f}")


if __name__ == "__main__":
    main()
