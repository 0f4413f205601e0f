"""What processes use: memory, open files, processor time; of this host's own accounts (Linux)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

MB = 1024.0
"""kB in a MB, as the kernel counts."""


def status_of(pid: int, name: str) -> float:
    """Return a size (MB) of a process by the kernel's name, e.g. VmRSS."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(f"{name}:"):
            return float(line.split()[1]) / MB
    raise ValueError(f"process {pid} has no {name}")


def forget_peak(pid: int) -> None:
    """Begin to look for the highest memory of a process anew."""
    Path(f"/proc/{pid}/clear_refs").write_text("5")


class Memory(NamedTuple):
    """Resident memory of a process (MB)."""

    before: float
    peak: float
    after: float

    @property
    def growth(self) -> float:
        """Peak beside what it was before."""
        return self.peak / self.before


class MemoryWatch:
    """Memory of processes from now on."""

    def __init__(self, pids: Mapping[str, int]) -> None:
        self._pids = dict(pids)
        self._before = {name: status_of(pid, "VmRSS") for name, pid in self._pids.items()}
        for pid in self._pids.values():
            forget_peak(pid)

    def read(self) -> dict[str, Memory]:
        """Return the memory of each so far."""
        return {
            name: Memory(self._before[name], status_of(pid, "VmHWM"), status_of(pid, "VmRSS"))
            for name, pid in self._pids.items()
        }


def log_bytes(folder: Path) -> int:
    """Return the bytes of all logs in a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*.log"))
