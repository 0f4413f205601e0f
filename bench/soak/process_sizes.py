"""Sizes of processes and use of the machine, as /proc tells them. Linux only."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from bench.long_runs import size

TICK = 1.0 / os.sysconf("SC_CLK_TCK")
"""Unit of the kernel's processor times (s)."""


class ProcessSize(NamedTuple):
    """Size of a process at one time."""

    at: float
    """When (s, monotonic)."""
    name: str
    """Agent, "plant" or "command"."""
    pid: int
    """Process id."""
    born: float
    """When it was started (s, monotonic)."""
    memory: float
    """Anonymous resident memory (MB)."""
    files: int
    """Open files, sockets among them."""

    @property
    def age(self) -> float:
        """Time since its start (s)."""
        return self.at - self.born


def size_of(name: str, pid: int, born: float, at: float) -> ProcessSize | None:
    """Return the size of a process now; None once it has ended."""
    try:
        files = sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())
    except OSError:
        return None
    memory = size(pid)
    return None if memory != memory else ProcessSize(at, name, pid, born, memory, files)


class MachineTime(NamedTuple):
    """Processor times (s) since the machine's start, at one time."""

    at: float
    """When (s, monotonic)."""
    whole: float
    """Of all processors, idle or not."""
    busy: float
    """Of all programs."""
    stolen: float
    """Time in which the host let others run."""
    own: float
    """Of the run's processes."""
    waited: float
    """Time in which the plant was ready and waited for a processor."""


def machine_time(at: float, own: float, waited: float) -> MachineTime:
    """Return the processor times now; what the kernel does not tell is 0.

    Parameters
    ----------
    at : float
        Now (s, monotonic).
    own : float
        Processor time (s) of the run's processes so far, also of those that have ended.
    waited : float
        Time (s) in which the plant was ready and waited for a processor so far, also of threads that have ended.
    """
    try:
        fields = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0].split()[1:9]
    except OSError:
        fields = ["0"] * 8
    user, nice, system, idle, iowait, irq, softirq, steal = (TICK * int(field) for field in fields)
    busy = user + nice + system + irq + softirq
    return MachineTime(
        at=at,
        whole=busy + idle + iowait + steal,
        busy=busy,
        stolen=steal,
        own=own,
        waited=waited,
    )


def waiting_times(pid: int) -> dict[int, float]:
    """Return how long (s) each thread of a process was ready and waited for a processor; empty once it has ended."""
    found = {}
    for file in Path(f"/proc/{pid}/task").glob("*/schedstat"):
        with suppress(OSError):  # the thread has just ended
            found[int(file.parent.name)] = 1e-9 * int(file.read_text(encoding="ascii").split()[1])
    return found
