"""Sizes of processes and use of the machine, as /proc tells them (Linux only), and what explains a late step.

A step is late if the plant makes it more than a control period after its due time. The plant counts them, and its
telemetry, five times a second, tells the count. What happened between two counts explains them, or nothing does.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

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


def size(pid: int, name: str = "RssAnon") -> float:
    """Return a size (MB) of a process by the kernel's name; not a number once it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return float("nan")
    return next((float(line.split()[1]) / 1024.0 for line in lines if line.startswith(f"{name}:")), float("nan"))


def processes(pid: int) -> dict[str, int]:
    """Return the command and its children, by name: that of the log, which a process that is forked has, too."""
    found = {"command": pid}
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in path.read_text().split():
            try:
                log = Path(f"/proc/{child}/fd/2").readlink()
            except OSError:  # it has just ended
                continue
            found[log.stem if log.suffix == ".log" else f"server {len(found)}"] = int(child)  # it forks the others
    return found


OTHERS = 0.1
"""Least part of the machine's time that other programs take to explain a late step."""

STOLEN = 0.01
"""Least time (s) that the host takes from the machine to explain one."""

WAITED = 0.005
"""Least time (s) that the plant waits for a processor if a start, or another program, is to explain one."""


class Start(NamedTuple):
    """A process that was started, while it got ready: imports, first session."""

    text: str
    """What it is, e.g. "agent inv2"."""
    begin: float
    """When it was started (s, monotonic)."""
    end: float
    """When it was ready, or had ended (s, monotonic)."""


class LateSteps(NamedTuple):
    """Late steps between two counts."""

    t: float
    """Run time (s)."""
    steps: int
    """How many."""
    waited: float
    """How long the plant waited for a processor meanwhile (s)."""
    causes: tuple[str, ...]
    """What explains them; empty if nothing does."""


def late_steps(t: float, steps: int, before: MachineTime, after: MachineTime, starts: Sequence[Start]) -> LateSteps:
    """Return what explains some late steps.

    Parameters
    ----------
    t : float
        Run time (s).
    steps : int
        How many steps were late.
    before, after : MachineTime
        The machine before them and after them.
    starts : Sequence[Start]
        Processes that were started in the run.

    Examples
    --------
    >>> before = MachineTime(at=10.0, whole=0.0, busy=0.0, stolen=0.0, own=0.0, waited=0.0)
    >>> busy = before._replace(at=10.4, whole=0.8, busy=0.7, own=0.2, waited=0.03)
    >>> late_steps(5.0, 1, before, busy, [Start("agent inv2", 9.9, 10.6)]).causes
    ('start of agent inv2', 'other programs: 62 % of the machine')
    >>> late_steps(5.0, 1, before, before._replace(at=10.4, whole=0.8, busy=0.2, own=0.2), []).causes
    ()
    """
    waited = after.waited - before.waited
    causes = []
    whole = after.whole - before.whole
    if waited >= WAITED:
        causes += [f"start of {start.text}" for start in starts if start.begin <= after.at and start.end >= before.at]
        others = (after.busy - before.busy) - (after.own - before.own)
        if whole > 0.0 and others >= OTHERS * whole:
            causes.append(f"other programs: {100.0 * others / whole:.0f} % of the machine")
    if (stolen := after.stolen - before.stolen) >= STOLEN:
        causes.append(f"the host took {1e3 * stolen:.0f} ms")
    return LateSteps(t, steps, waited, tuple(causes))
