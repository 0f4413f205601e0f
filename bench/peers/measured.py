"""Measurements of one run of the bench: rounds in which all take turns, the machine's load, versions, and medians."""

from __future__ import annotations

import os
import resource
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from statistics import median
from typing import NamedTuple

import msgspec

from bench.harness import machine, say

REPOSITORY = Path(__file__).parents[2]

PACKAGES = ("eclipse-zenoh", "helics", "gridlabd", "pyzmq", "numpy", "scipy", "numba", "msgspec")


class MissingRivalError(RuntimeError):
    """A rival's package is not installed."""


class Measure(NamedTuple):
    """One thing that is measured, or several at once."""

    name: str
    """For progress, and where it is left out."""
    run: Callable[[], Mapping[str, float]]
    """Measure once, by the names of the values."""
    needs: str = ""
    """Distribution of the rival; without it the measure is left out and named."""
    rounds: int | None = None
    """Rounds in which it takes part; all when left out."""


class PartRun(msgspec.Struct, kw_only=True):
    """The measurements of one part of the bench."""

    began: str
    commit: str
    """Of this repository; "+" behind it marks changes that were not committed."""
    machine: str
    """Processor, cores, load before, system."""
    versions: dict[str, str]
    loads: list[float]
    """Load (1 min) before, and after each round."""
    others: float = 0.0
    """Part of the machine's processor time that other programs took meanwhile."""
    seconds: float = 0.0
    """Duration."""
    values: dict[str, list[float]] = {}
    """Values of each round, by name."""
    left_out: dict[str, str] = {}
    """Measures that could not be done, and the reason."""

    def median(self, name: str) -> float:
        """Return the median of a value over the rounds; nan if it was not measured."""
        return median(self.values[name]) if self.values.get(name) else float("nan")


def measure_in_turns(measures: Sequence[Measure], rounds: int) -> PartRun:
    """Measure all, round by round, each round in another order; a measure that fails is left out from then on."""
    part = PartRun(
        began=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        commit=_commit(),
        machine=machine(),
        versions=_versions(),
        loads=[round(os.getloadavg()[0], 2)],
    )
    began, busy, own = time.monotonic(), _machine_time(), _own_time()
    for measure in measures:
        if measure.needs and not _version(measure.needs):
            part.left_out[measure.name] = f"{measure.needs} is not installed: pip install 'gridpeers[bench]'"
    for i in range(rounds):
        k = i % max(len(measures), 1)
        for measure in (*measures[k:], *measures[:k]):
            if measure.name in part.left_out or (measure.rounds is not None and i >= measure.rounds):
                continue
            say(f"round {i + 1} of {rounds}: {measure.name}")
            try:
                for name, value in measure.run().items():
                    part.values.setdefault(name, []).append(value)
            except (RuntimeError, OSError, TimeoutError) as error:
                part.left_out[measure.name] = f"{type(error).__name__}: {str(error)[-300:]}"
        part.loads.append(round(os.getloadavg()[0], 2))
    part.seconds = round(time.monotonic() - began, 1)
    whole = part.seconds * (os.cpu_count() or 1)
    part.others = round(max(0.0, (_machine_time() - busy) - (_own_time() - own)) / whole, 3) if whole else 0.0
    return part


def _machine_time() -> float:
    """Return the processor time (s) that all programs of the machine have taken so far; 0 where /proc is not."""
    try:
        fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    except OSError:
        return 0.0
    user, nice, system, _idle, _iowait, irq, softirq, steal, *_ = map(int, fields)
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")


def _own_time() -> float:
    """Return the processor time (s) of this process and its ended children so far."""
    uses = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(use.ru_utime + use.ru_stime for use in uses)


def _commit() -> str:
    def git(*words: str) -> str:
        return subprocess.run(
            ["git", *words], cwd=REPOSITORY, capture_output=True, text=True, check=True
        ).stdout.strip()

    try:
        return git("rev-parse", "--short=10", "HEAD") + ("+" if git("status", "--porcelain") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _versions() -> dict[str, str]:
    return {name: version for name in PACKAGES if (version := _version(name))}


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""
