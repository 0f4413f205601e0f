"""Memory of every process of a recorded run: resident size over time, and by how much it grows in an hour of run time.

    python bench/memory.py --minutes 60                     # an hour at real time
    python bench/memory.py --minutes 6 --speed 10           # an hour of run time in six minutes

Linux only: sizes are from /proc. The first part of the run is left out of the slope (`--skip`): caches fill, and the
plant keeps the latest 4 MB for recorders. At the end the command reads the history back for its numbers and figures;
what it then needs is told as its peak.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from time import monotonic, sleep

import numpy as np

from scenarios.drivers.rendezvous import rendezvous

MB = 1024.0 * 1024.0
FLAT = 2.0
"""Growth (MB per hour of run time) that is told as flat: 0.05 % of what a run once took."""


def memory(pid: int) -> dict[str, float]:
    """Sizes (MB) of a process by the kernel's names, e.g. RssAnon; empty once it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return {}
    fields = (line.split() for line in lines)
    return {words[0].rstrip(":"): float(words[1]) * 1024.0 / MB for words in fields if words[-1:] == ["kB"]}


def children(pid: int) -> dict[str, int]:
    """Process ids of the children of a process by the name that they were given."""
    found = {}
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in path.read_text().split():
            try:
                found[Path(f"/proc/{child}/cmdline").read_text().split("\0")[-2]] = int(child)
            except (OSError, IndexError):  # it has just ended, or not yet begun
                continue
    return found


def slope(samples: list[tuple[float, float]], skip: float) -> float:
    """Growth (MB/s) by least squares over what comes after a part of the time."""
    t, size = np.array(samples).T
    late = t >= t[0] + skip * (t[-1] - t[0])
    return float(np.polyfit(t[late], size[late], 1)[0]) if late.sum() > 2 else float("nan")


def watch(process: subprocess.Popen[bytes], seconds: float, every: float) -> dict[str, list[tuple[float, float]]]:
    """Sizes (MB, anonymous resident memory) of a command and its children over time (s)."""
    sizes: dict[str, list[tuple[float, float]]] = {}
    began = monotonic()
    while (t := monotonic() - began) < seconds and process.poll() is None:
        for name, pid in {"command": process.pid, **children(process.pid)}.items():
            size = memory(pid).get("RssAnon")
            if size is not None:
                sizes.setdefault(name, []).append((t, size))
        sleep(every)
    return sizes


def main() -> None:
    """Run, watch, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default="islanding", help="what to run")
    parser.add_argument("--minutes", type=float, default=60.0, help="how long (wall)")
    parser.add_argument("--speed", type=float, default=1.0, help="run time per wall time")
    parser.add_argument("--every", type=float, default=5.0, help="time (s) between two looks")
    parser.add_argument("--skip", type=float, default=0.3, help="part of the time that is left out")
    parser.add_argument(
        "--link", nargs=argparse.REMAINDER, help='last: words for gridpeers link, e.g. set "* -> inv1" --loss 0.1'
    )
    arguments = parser.parse_args()
    command = [sys.executable, "-P", "-c", "from gridpeers.cli.app import main; main()"]
    with tempfile.TemporaryDirectory(prefix="gridpeers-memory-") as folder:
        endpoint, run = rendezvous(), f"memory{os.getpid()}"
        words = ["up", arguments.scenario, "--run", run, "--listen", endpoint, "--speed", f"{arguments.speed:g}"]
        with (Path(folder) / "up.log").open("wb") as log:
            up = subprocess.Popen([*command, *words, "--out", f"{folder}/here"], stdout=log, stderr=log)
            try:
                history = Path(folder) / "here"
                while up.poll() is None and not any(
                    file.stat().st_size for file in history.glob("*/history.partial.csv")
                ):
                    sleep(0.2)
                if arguments.link:
                    subprocess.run([*command, "link", *arguments.link, "--run", run, "--connect", endpoint], check=True)
                sizes = watch(up, 60.0 * arguments.minutes, arguments.every)
                peak = memory(up.pid).get("VmHWM", float("nan"))
                up.send_signal(signal.SIGTERM)  # SIGINT is ignored by what was started in the background
                while up.poll() is None:
                    peak = max(peak, memory(up.pid).get("VmHWM", 0.0))
                    sleep(0.1)
            finally:
                up.kill()
                up.wait()
        told = (Path(folder) / "up.log").read_text(errors="replace")
    print(next((line for line in told.splitlines() if line.startswith("ended at")), told))
    print(f"{'MB, anonymous resident':24}{'first':>9}{'last':>9}{'most':>9}{'MB/h of run time':>18}{'':3}")
    for name, samples in sizes.items():
        growth = slope(samples, arguments.skip) * 3600.0 / arguments.speed
        most = max(size for _, size in samples)
        word = "" if abs(growth) <= FLAT else "grows" if growth > 0 else "shrinks"
        print(f"{name:24}{samples[0][1]:9.1f}{samples[-1][1]:9.1f}{most:9.1f}{growth:18.1f}   {word}")
    print(f"peak of the command, its numbers and figures at the end included: {peak:.0f} MB resident")


if __name__ == "__main__":
    main()
