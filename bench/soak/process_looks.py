"""Sizes of processes, as /proc tells them. Linux only."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple


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
