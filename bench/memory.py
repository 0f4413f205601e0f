"""The memory of every process of a recorded run in real time, and its growth in an hour of run time.

    python -m bench.memory --minutes 60              an hour at real time
    python -m bench.memory --minutes 6 --speed 10    an hour of run time in six minutes

Linux only: sizes are from /proc. The first part of the run does not count (`--skip`, percent): caches fill, and the
plant keeps the latest 4 MB for recorders.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from time import monotonic, sleep

import numpy as np

from bench.harness import machine, options, say
from scenarios.drivers.free_endpoint import free_endpoint

KB = 1024.0
FLAT = 2.0
"""Growth (MB per hour of run time) that counts as none."""

EVERY = 5.0
"""Time (s) between two looks."""


def size(pid: int, name: str = "RssAnon") -> float:
    """Return a size (MB) of a process by the kernel's name; not a number once it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return float("nan")
    return next((float(line.split()[1]) / KB for line in lines if line.startswith(f"{name}:")), float("nan"))


def processes(pid: int) -> dict[str, int]:
    """Return the command and its children, by name."""
    found = {"command": pid}
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in path.read_text().split():
            try:
                found[Path(f"/proc/{child}/cmdline").read_text().split("\0")[-2]] = int(child)
            except (OSError, IndexError):  # it has just ended, or not yet begun
                continue
    return found


def main() -> None:
    """Run, watch, and print a table."""
    given = options(__doc__, scenario="islanding", minutes=60, speed=1, skip=30)
    say(machine())
    command = [sys.executable, "-P", "-c", "from gridpeers.cli.app import main; main()", "up", given.scenario]
    samples: dict[str, list[tuple[float, float]]] = {}
    with tempfile.TemporaryDirectory(prefix="gridpeers-memory-") as folder:
        words = ["--run", f"memory{os.getpid()}", "--listen", free_endpoint(), "--speed", str(given.speed)]
        with (Path(folder) / "up.log").open("wb") as log:
            up = subprocess.Popen([*command, *words, "--out", f"{folder}/here"], stdout=log, stderr=log)
            try:
                rows = Path(folder) / "here"
                while up.poll() is None and not any(path.stat().st_size for path in rows.glob("*/history.partial.csv")):
                    sleep(0.2)
                began, peak = monotonic(), 0.0
                while (t := monotonic() - began) < 60.0 * given.minutes and up.poll() is None:
                    for name, pid in processes(up.pid).items():
                        samples.setdefault(name, []).append((t, size(pid)))
                    sleep(EVERY)
                up.send_signal(signal.SIGTERM)  # the background ignores SIGINT
                while up.poll() is None:
                    peak = max(peak, np.nan_to_num(size(up.pid, "VmHWM")))
                    sleep(0.1)
            finally:
                up.kill()
                up.wait()
        text = (Path(folder) / "up.log").read_text(errors="replace")
    print(next((line for line in text.splitlines() if line.startswith("ended at")), text))
    print(f"{'MB, anonymous resident':24}{'first':>9}{'last':>9}{'MB/h of run time':>18}")
    for name, values in samples.items():
        t, sizes = np.array(values).T
        late = (t >= t[0] + given.skip / 100.0 * (t[-1] - t[0])) & np.isfinite(sizes)
        growth = np.polyfit(t[late], sizes[late], 1)[0] * 3600.0 / given.speed if late.sum() > 2 else float("nan")
        verdict = "" if abs(growth) <= FLAT else "grows" if growth > 0 else "shrinks"
        print(f"{name:24}{sizes[0]:9.1f}{sizes[-1]:9.1f}{growth:18.1f}   {verdict}")
    print(f"peak of the command, its numbers and figures at the end included: {peak:.0f} MB resident")


if __name__ == "__main__":
    main()
