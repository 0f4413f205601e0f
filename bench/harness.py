"""Shared by all benches: the machine, its load and what others take of it, commands, failures in a line, tables."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from importlib import metadata
from pathlib import Path

import psutil

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, before numpy is imported

GRIDPEERS = (sys.executable, "-P", "-c", "from gridpeers.cli.app import main; main()")
"""The command `gridpeers` of this interpreter."""

REPOSITORY = Path(__file__).parents[1]

PACKAGES = ("eclipse-zenoh", "helics", "gridlabd", "pyzmq", "joblib", "numpy", "scipy", "numba", "msgspec")
"""Distributions whose versions stand beside measurements."""

LONGEST = 300
"""Most characters of the reason of a failure."""

DEADLINE = 600.0
"""Longest time (s) for a command."""


def say(text: str) -> None:
    """Show progress."""
    print(f"{text} ...", file=sys.stderr, flush=True)


def machine() -> str:
    """Return one line on processor, cores, load, system and versions."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [row.partition(":")[2].strip() for row in cpuinfo.read_text().splitlines() if "model name" in row]
        model = names[0] if names else model
    versions = ", ".join(f"{name} {installed}" for name in PACKAGES if (installed := version(name)))
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{model}, {os.cpu_count()} cores, load {load()}; {system}, {versions}"


def load() -> str:
    """Return the load of the machine over 1, 5 and 15 minutes."""
    return ", ".join(f"{value:.1f}" for value in os.getloadavg())


def commit() -> str:
    """Return the commit of this repository; "+" behind it marks changes that are not committed."""

    def git(*words: str) -> str:
        found = subprocess.run(["git", *words], cwd=REPOSITORY, capture_output=True, text=True, check=True)
        return found.stdout.strip()

    try:
        changed = git("status", "--porcelain", "--", ".", ":!docs")  # benches write into docs
        return git("rev-parse", "--short=10", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def version(distribution: str) -> str:
    """Return the version of a distribution; "" where it is not installed."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


class MachineUse:
    """The use of the machine from now on."""

    def __init__(self) -> None:
        self._began, self._busy, self._own = time.monotonic(), _busy_time(), own_time()

    @property
    def seconds(self) -> float:
        """Duration so far (s)."""
        return time.monotonic() - self._began

    @property
    def others(self) -> float:
        """Part of the machine's processor time that other programs took."""
        taken = (_busy_time() - self._busy) - (own_time() - self._own)
        return min(1.0, max(0.0, taken) / (self.seconds * (os.cpu_count() or 1)))


def _busy_time() -> float:
    """Return the processor time (s) that all programs of the machine have taken so far."""
    times = psutil.cpu_times()._asdict()
    return sum(float(times.get(name, 0.0)) for name in ("user", "nice", "system", "irq", "softirq", "steal"))


def own_time() -> float:
    """Return the processor time (s) of this process, its ended children, and its living descendants so far."""
    return sum(os.times()[:4]) + sum(processor_time(one.pid) for one in psutil.Process().children(recursive=True))


def processor_time(pid: int) -> float:
    """Return the processor time (s) of a process and of its ended children; 0 once it has ended."""
    try:
        times = psutil.Process(pid).cpu_times()
    except psutil.Error:
        return 0.0
    return float(times.user + times.system + times.children_user + times.children_system)


def checked(command: Sequence[str], timeout: float = DEADLINE) -> str:
    """Run a command and return what it prints.

    Raises
    ------
    subprocess.CalledProcessError, subprocess.TimeoutExpired
        If it fails; `reason` makes a line of it.
    """
    done = subprocess.run(
        command, check=True, capture_output=True, text=True, errors="replace", timeout=timeout, cwd=REPOSITORY
    )
    return done.stdout


def reason(error: Exception) -> str:
    r"""Return what went wrong as one line: the command and its last line, or the first and the last line of the error.

    Examples
    --------
    >>> reason(subprocess.CalledProcessError(3, ["ls", "x y"], stderr="a\nno such file\n"))
    "`ls 'x y'` ended with 3: no such file"
    >>> reason(RuntimeError("inv1 died\nits log\nOSError: no room"))
    'inv1 died ... OSError: no room'
    """
    if isinstance(error, subprocess.CalledProcessError):
        last = _lines(error.stderr)[-1:] or ["it printed no error"]
        return f"`{_words(error.cmd)}` ended with {error.returncode}: {last[0]}"[:LONGEST]
    if isinstance(error, subprocess.TimeoutExpired):
        return f"`{_words(error.cmd)}` had not ended after {error.timeout:g} s"[:LONGEST]
    lines = _lines(str(error))
    if not lines:
        return type(error).__name__
    first = lines[0] if isinstance(error, RuntimeError) else f"{type(error).__name__}: {lines[0]}"
    return (first if len(lines) == 1 else f"{first} ... {lines[-1]}")[:LONGEST]


def _words(command: Sequence[str]) -> str:
    """Return a command as a person types it."""
    words = list(command)
    if tuple(words[: len(GRIDPEERS)]) == GRIDPEERS:
        words[: len(GRIDPEERS)] = ["gridpeers"]
    elif words[0] == sys.executable:
        words[0] = "python"
    return shlex.join(words)


def _lines(text: str | None) -> list[str]:
    return [line.strip() for line in (text or "").splitlines() if line.strip()]


def markdown(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    r"""Return a table for a page; numbers have three digits.

    Examples
    --------
    >>> print(markdown(("what", "s"), [("a | b", 0.12345)]))
    | what | s |
    | --- | --- |
    | a \| b | 0.123 |
    """
    cells = [[f"{x:.3g}" if isinstance(x, float) else str(x).replace("|", "\\|") for x in row] for row in rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in [list(head), ["---"] * len(head), *cells])
