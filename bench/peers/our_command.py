"""Our command in a process of its own, by the clock: the help; a run with processes to its first row and its end."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from time import perf_counter, sleep

from bench.harness import GRIDPEERS
from bench.peers.failure import DEADLINE, checked
from bench.peers.our_case import CASE, OurCase
from scenarios.results.record import PARTIAL

LOOK = 0.002
"""Time (s) between two looks at the history that is being written."""


def help_time() -> dict[str, float]:
    """Measure `gridpeers --help` (s)."""
    began = perf_counter()
    checked([*GRIDPEERS, "--help"])
    return {"ours.help": perf_counter() - began}


def command_times(case: OurCase) -> dict[str, float]:
    """Measure `gridpeers run` with processes (s) from its start: to its first row, to its last, and to its end.

    The last row is there once the history has its name; tables and figures follow.
    """
    with tempfile.TemporaryDirectory(prefix="gp-command-") as name:
        folder = Path(name)
        file, out, log = folder / "islanding.toml", folder / "out", folder / "log"
        file.write_text(case.scenario.to_toml(), encoding="utf-8")
        command = [*GRIDPEERS, "run", str(file), "--case", CASE, "--driver", "processes", "--out", str(out)]
        with log.open("wb") as errors:
            began = perf_counter()
            run = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=errors, stderr=errors)
            try:
                first = _until(run, out / CASE / PARTIAL, out / CASE / "history.csv") - began
                last = _until(run, out / CASE / "history.csv") - began
                run.wait(DEADLINE)
                end = perf_counter() - began
            finally:
                run.kill()
                run.wait()
        if run.returncode:
            raise subprocess.CalledProcessError(run.returncode, command, stderr=log.read_text(errors="replace"))
    return {"ours.command.first_row": first, "ours.command.last_row": last, "ours.command.end": end}


def _until(run: subprocess.Popen[bytes], *files: Path) -> float:
    """Return the time at which one of some files has something in it, or the command has ended."""
    until = perf_counter() + DEADLINE
    while run.poll() is None and perf_counter() < until:
        for file in files:
            try:
                if file.stat().st_size:
                    return perf_counter()
            except FileNotFoundError:
                continue
        sleep(LOOK)
    return perf_counter()
