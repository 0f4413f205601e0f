"""The conditions of a measurement: commit, versions, and how much of the machine other programs used meanwhile."""

from __future__ import annotations

import os
import resource
import subprocess
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]

PACKAGES = ("eclipse-zenoh", "helics", "gridlabd", "pyzmq", "joblib", "numpy", "scipy", "numba", "msgspec")


class MachineUse:
    """The use of the machine from now on."""

    def __init__(self) -> None:
        self._began, self._busy, self._own = time.monotonic(), _machine_time(), own_time()

    @property
    def seconds(self) -> float:
        """Duration so far (s)."""
        return time.monotonic() - self._began

    @property
    def others(self) -> float:
        """Part of the machine's processor time that other programs took; 0 where /proc is not."""
        whole = self.seconds * (os.cpu_count() or 1)
        taken = (_machine_time() - self._busy) - (own_time() - self._own)
        return min(1.0, max(0.0, taken) / whole) if whole else 0.0


def load() -> float:
    """Return the load of the machine over a minute."""
    return round(os.getloadavg()[0], 2)


def commit() -> str:
    """Return the commit of this repository; "+" behind it marks changes that are not committed."""

    def git(*words: str) -> str:
        found = subprocess.run(["git", *words], cwd=REPOSITORY, capture_output=True, text=True, check=True)
        return found.stdout.strip()

    try:
        changed = git("status", "--porcelain", "--", ".", ":!docs")  # the bench itself writes into docs
        return git("rev-parse", "--short=10", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def versions() -> dict[str, str]:
    """Return the versions of all that is measured and is installed."""
    return {name: found for name in PACKAGES if (found := version(name))}


def version(distribution: str) -> str:
    """Return the version of a distribution; "" where it is not installed."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


def _machine_time() -> float:
    """Return the processor time (s) that all programs of the machine have taken so far; 0 where /proc is not."""
    try:
        fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    except OSError:
        return 0.0
    user, nice, system, _idle, _iowait, irq, softirq, steal, *_ = map(int, fields)
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")


def own_time() -> float:
    """Return the processor time (s) of this process, its ended children, and its living descendants so far."""
    uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    living = sum(map(_time_with_children, _descendants(os.getpid())))
    return sum(use.ru_utime + use.ru_stime for use in uses) + living


def _descendants(pid: int) -> Iterator[int]:
    for file in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            children = [int(child) for child in file.read_text().split()]
        except OSError:  # the thread, or the process, has just ended
            continue
        for child in children:
            yield child
            yield from _descendants(child)


def _time_with_children(pid: int) -> float:
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
