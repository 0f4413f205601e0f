"""Recorded runs of which a process is killed, and what their records must have then."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep, time  # noqa: TID251  # beside the time of a file
from typing import Literal, NamedTuple

from gridpeers.lab.replay.recomputation import recomputed
from gridpeers.scenarios.record.record_file import RecordFile, RecordFileError
from gridpeers.scenarios.record.record_info import FILE
from gridpeers.scenarios.record.record_reader import RunRecord
from tests.command_line import invoke

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

Clock = Literal["simulated", "one process", "realtime"]

CLOCKS: tuple[Clock, ...] = ("simulated", "one process", "realtime")
"""Kinds of runs: in simulated time with processes and without, and in real time."""


class Left(NamedTuple):
    """What a killed command has left behind."""

    record: RunRecord
    lost: float
    """Time (s) from the record's last chunk to the kill; its nodes had kept the first of it for 0.2 s."""


def killed(folder: Path, clock: Clock, after: float, who: str = "command", *, most: float) -> Left:
    """Run a case until its first row is there, kill a process some time (s) later, and open what is left.

    It is killed earlier once the run has gone on by `most` (s of run time), as a busy machine may wake this process
    late; but not before its record has a chunk with rows.
    """
    folder.mkdir(parents=True)
    (folder / "long.toml").write_text(LONG + ("" if clock == "one process" else LOSSY), encoding="utf-8")
    pace = ("--driver", "inprocess") if clock == "one process" else ("--clock", clock)
    words = [sys.executable, "-m", "gridpeers", "run", "long.toml", *pace, "--out", "out"]
    command = subprocess.Popen(words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    file = folder / "out" / "IV" / FILE
    try:
        t = wait_for_rows(command, file)
        until = monotonic() + after
        wait_for_rows(command, file, lambda now: now > t and (now >= t + most or monotonic() >= until))
        process = command.pid if who == "command" else _process(command.pid, who)
        t = _last_time(file)
        killed_at = time()
        os.kill(process, signal.SIGKILL)
        if who == "plant":  # the run breaks, and the command closes its files
            command.wait(60.0)
        elif who != "command":
            wait_for_rows(command, file, lambda now: now > t + 0.2)
    finally:
        command.kill()
        command.wait()
    return Left(RunRecord.open(file), killed_at - file.stat().st_mtime)


def wait_for_rows(
    command: subprocess.Popen[bytes], file: Path, enough: Callable[[float], bool] = lambda t: t >= 0.0
) -> float:
    """Wait until the last run time (s) of a record is enough, and return it."""
    deadline = monotonic() + 120.0
    while not enough(t := _last_time(file)):
        assert command.poll() is None, "the command ended by itself"
        assert monotonic() < deadline, "no rows within 120 s"
        sleep(0.02)
    return t


def _last_time(file: Path) -> float:
    """Return the last run time (s) in a record; -1 before it has a part."""
    try:
        return (RecordFile(file).ends or [-1.0])[-1]
    except RecordFileError:
        return -1.0


def _process(parent: int, name: str) -> int:
    """Return the process of the run with a name, a child of the command."""
    words = ["pgrep", "-P", str(parent), "-f", "--", f"--leash {name}$"]
    return int(subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()[0])


def assert_usable(left: Left, *, complete: bool = False) -> None:
    """The record opens, lacks at most the last second, and decisions are made again from all that it has."""
    record = left.record
    assert record.complete == complete
    assert complete or any("cut off" in text for text in record.damage)
    assert left.lost <= 1.0, f"the last chunk, up to {record.t_end:.2f} s, came {left.lost:.2f} s before the kill"
    begun = record.t_end > 0.5  # in one process a second of run time passes before the first chunk: `lost` judges that
    assert not begun or len(record.physics().t) > 1
    for agent in record.agents[:2]:
        again = list(recomputed(record, agent))
        assert all(each.agrees for each in again)
        assert not begun or again


def assert_commands_read(record: RunRecord, agent: str = "inv4") -> None:
    """`export`, `why`, `trace` and `replay` do their work, and tell the cut."""
    folder, file = record.path.parent, str(record.path)
    commands = {
        "export": (file, "--to", "csv", "--out", str(folder / "tables")),
        "why": (file, agent, f"{record.t_end:.3f}"),
        "trace": (file, "--out", str(folder / "trace.pftrace")),
        "replay": (file,),
    }
    for command, arguments in commands.items():
        code, printed = invoke(command, *arguments)
        assert code == 0, f"gridpeers {command} {' '.join(arguments)}: {code}: {printed}"
        assert "Traceback" not in printed
        assert record.complete or command == "replay" or "cut off" in printed, f"{command}: {printed}"
    assert (folder / "trace.pftrace").stat().st_size > 500
