"""Memory, files and time per tick of long runs: nothing may grow with the length of a run but its files.

    python -m bench.long_runs                              all: 600 s simulated, links 200 s, live 10 min by the clock
    python -m bench.long_runs inprocess --seconds 3600     one of them, and longer
    python -m bench.long_runs live --minutes 6 --speed 10  an hour of run time in six minutes
    python -m bench.long_runs --write docs                 all four, for docs/performance.md

`inprocess` and `processes` run the islanding in simulated time, `links` too, in one process and with a delay on every
link, so that each message has a row in links.csv; `live` is `gridpeers up` in wall-clock time. Linux only: sizes are
anonymous resident memory, from /proc. The first part of a run does not count (`--skip`, percent): caches fill, and the
plant keeps its latest messages for recorders.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from time import monotonic, sleep
from typing import NamedTuple

import numpy as np

import gridpeers as gp
from bench.harness import GRIDPEERS, load, machine, say
from bench.peers.long_parts import LONG_RUNS, long_part
from bench.peers.measured import Measure, measure_in_turns
from bench.peers.publish import keep, publish
from bench.peers.stored import DATA_FILE
from scenarios.drivers.free_endpoint import free_endpoint
from scenarios.results.record import PARTIAL

FLAT = 0.05
"""Growth from the warm-up to the end, as a part of the size after the warm-up, that counts as none."""

STEADY = 0.25
"""Part by which the time per tick of the last quarter may be beyond that of the first, as other programs run, too."""

KB = 1024.0

SMALL = 1e5
"""Size (B) up to which a file is not worth a word."""

FEWEST = 8
"""Looks that a run needs to say anything."""

RUNS = tuple(LONG_RUNS)


class Sample(NamedTuple):
    """One look at a run."""

    at: float
    """Time since the start (s)."""
    written: int
    """Size (B) of the history so far: rows are of nearly equal length, so that it stands for run time."""
    sizes: Mapping[str, float]
    """Memory (MB) of every process."""
    busy: float
    """Processor time (s) of all processes so far."""


def size(pid: int, name: str = "RssAnon") -> float:
    """Return a size (MB) of a process by the kernel's name; not a number once it has ended."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return float("nan")
    return next((float(line.split()[1]) / KB for line in lines if line.startswith(f"{name}:")), float("nan"))


def processor_time(pid: int) -> float:
    """Return the processor time (s) of a process; 0 once it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def processes(pid: int) -> dict[str, int]:
    """Return the command and its children, by name: that of the log, which a process that is forked has, too."""
    found = {"command": pid}
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in path.read_text().split():
            try:
                log = Path(f"/proc/{child}/fd/2").readlink()
            except OSError:  # it has just ended
                continue
            name = log.stem if log.suffix == ".log" else f"server {len(found)}"  # it forks the others
            found[name] = int(child)
    return found


def written(folder: Path) -> int:
    """Return the size (B) of the history that is being written; 0 while there is none."""
    return sum(path.stat().st_size for path in folder.glob(f"*/{PARTIAL}"))


def simulated(kind: str, given: argparse.Namespace) -> float:
    """Return the simulated time (s) of a run; that with links writes a row a message, and is shorter."""
    return float(given.seconds / 3.0 if kind == "links" else given.seconds)


def command_of(kind: str, folder: Path, given: argparse.Namespace) -> list[str]:
    """Return the command of a run into a folder of its own."""
    out = ["--out", str(folder / "here")]
    if kind == "live":
        words = ["--run", f"long{os.getpid()}", "--listen", free_endpoint(), "--speed", f"{given.speed:g}"]
        return [*GRIDPEERS, "up", "islanding", *words, *out]
    changes: dict[str, object] = {"time.end_s": simulated(kind, given)}
    if kind == "links":
        changes["link"] = [{"on": "* <-> *", "delay": 0.01}]
    file = folder / "long.toml"
    file.write_text(gp.load("islanding").replace({"paper": None}).replace(changes).to_toml(), encoding="utf-8")
    driver = "processes" if kind == "processes" else "inprocess"
    return [*GRIDPEERS, "run", str(file), "--case", "IV", "--driver", driver, *out]


def watch(kind: str, given: argparse.Namespace) -> dict[str, float]:
    """Run, watch, print a table, and return what was found."""
    samples: list[Sample] = []
    busy: dict[str, float] = {}
    with tempfile.TemporaryDirectory(prefix="gridpeers-long-") as name:
        folder, peak = Path(name), 0.0
        command = command_of(kind, folder, given)
        with (folder / "log").open("wb") as log:
            run = subprocess.Popen(command, stdout=log, stderr=log)
            try:
                while run.poll() is None and not written(folder / "here"):
                    sleep(0.05)
                began = monotonic()
                until = 60.0 * given.minutes if kind == "live" else float("inf")
                while (
                    (at := monotonic() - began) < until and run.poll() is None and (so_far := written(folder / "here"))
                ):
                    pids = processes(run.pid)
                    sizes = {process: size(pid) for process, pid in pids.items()}
                    for process, pid in pids.items():  # one that has ended keeps what it took
                        busy[process] = max(busy.get(process, 0.0), processor_time(pid))
                    samples.append(Sample(at, so_far, sizes, sum(busy.values())))
                    sleep(given.every)
                if kind == "live":
                    run.send_signal(signal.SIGTERM)  # the background ignores SIGINT
                while run.poll() is None:
                    peak = max(peak, np.nan_to_num(size(run.pid, "VmHWM")))
                    sleep(0.05)
            finally:
                run.kill()
                run.wait()
        text = (folder / "log").read_text(errors="replace")
        files = {path.name: path.stat().st_size for path in sorted((folder / "here").rglob("*.csv"))}
    if len(samples) < FEWEST:
        last = text.strip().splitlines()[-1:] or ["it printed nothing"]
        raise RuntimeError(f"{len(samples)} looks, at least {FEWEST} are needed; the run ended with: {last[0]}")
    found = report(kind, samples, files, peak, given)
    print(next((line for line in text.splitlines() if line.startswith("ended at")), ""))
    return {f"{kind}.{name}": value for name, value in found.items()}


def report(
    kind: str, samples: list[Sample], files: Mapping[str, int], peak: float, given: argparse.Namespace
) -> dict[str, float]:
    """Print what was seen of one run, and return it."""
    print(f"\n{kind}: {len(samples)} looks in {samples[-1].at:.0f} s; load {load()}")
    names = list(dict.fromkeys(name for sample in samples for name in sample.sizes))
    t = np.array([sample.at for sample in samples])
    warm = t >= given.skip / 100.0 * t[-1]
    memory: dict[str, float] = {}
    most = 0.0
    print(f"{'memory (MB)':24}{'start':>9}{'warm':>9}{'last':>9}{'growth':>9}")
    for name in names:
        sizes = np.array([sample.sizes.get(name, np.nan) for sample in samples])
        there = np.flatnonzero(np.isfinite(sizes) & warm)
        if len(there) < 3:
            continue
        first, last = sizes[there[0]], sizes[there[-1]]
        growth = last / first - 1.0
        role = name if name in ("command", "plant") else "a server" if name.startswith("server") else "an agent"
        memory[role] = max(memory.get(role, 0.0), float(last))
        most = max(most, float(growth))
        print(f"{name:24}{sizes[0]:9.1f}{first:9.1f}{last:9.1f}{growth:9.1%}   {'' if growth <= FLAT else 'GROWS'}")
    if peak:
        print(f"{'peak of the command at its end: numbers, figures':51}{peak:9.1f}")
    progress = np.array([sample.written for sample in samples], float)
    grown = np.flatnonzero(np.diff(progress, prepend=-1.0) > 0.0)  # what ends a run, files to be closed, is no tick
    share = (progress[grown] - progress[0]) / (progress[-1] - progress[0])
    busy = np.array([samples[look].busy for look in grown])
    quarters = np.interp([0.0, 0.25, 0.75, 1.0], share, busy)
    ratio = float((quarters[3] - quarters[2]) / (quarters[1] - quarters[0]))
    print(f"processor time per tick, last quarter : first: {ratio:.2f}   {'' if ratio <= 1.0 + STEADY else 'GROWS'}")
    print("files (MB): " + ", ".join(f"{name} {bytes_ / 1e6:.1f}" for name, bytes_ in files.items()))
    return {
        "growth": 100.0 * most,
        "late_ticks": ratio,
        "seconds": samples[-1].at if kind == "live" else simulated(kind, given),
        **{f"memory.{role}": megabytes for role, megabytes in memory.items()},
        **{f"file.{name}": bytes_ / 1e6 for name, bytes_ in files.items() if bytes_ > SMALL},
    }


def main() -> int:
    """Measure, print, and write what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="*", metavar="RUN", help=f"{', '.join(RUNS)}; all by default")
    parser.add_argument("--seconds", type=float, default=600.0, help="simulated (default 600)")
    parser.add_argument("--minutes", type=float, default=10.0, help="of the live run, on the clock (default 10)")
    parser.add_argument("--speed", type=float, default=1.0, help="of the live run (default 1)")
    parser.add_argument(
        "--skip", type=float, default=20.0, help="percent of the run that count as warm-up (default 20)"
    )
    parser.add_argument("--every", type=float, default=0.2, help="seconds between two looks (default 0.2)")
    parser.add_argument(
        "--write",
        type=Path,
        metavar="DIR",
        help="keep the numbers in DIR/performance.json, and write DIR/performance.md",
    )
    given = parser.parse_args()
    if unknown := [name for name in given.runs if name not in RUNS]:
        parser.error(f'run "{unknown[0]}": there is no such run; choose from {", ".join(RUNS)}')
    print(machine())
    failed = False
    for kind in given.runs or RUNS:
        say(kind)
        measure = Measure(kind, partial(watch, kind, given), values=(f"{kind}.growth", f"{kind}.late_ticks"))
        part = measure_in_turns(partial(list, [measure]), 1)
        failed = failed or part.failed
        print("\n".join(f"{name}: {why}" for name, why in part.left_out.items()), file=sys.stderr)
        if given.write:
            keep(long_part(kind), part, given.write / DATA_FILE)
    if given.write:
        print(publish(given.write))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
