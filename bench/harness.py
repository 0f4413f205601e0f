"""Shared by all benches: options, the machine and its load, measurements beside a rival in the same run, and tables."""

from __future__ import annotations

import argparse
import math
import os
import platform
import sys
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from statistics import median

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, before numpy is imported

GRIDPEERS = (sys.executable, "-P", "-c", "from gridpeers.cli.app import main; main()")
"""The command `gridpeers` of this interpreter."""


def options(text: str | None, **defaults: float | str) -> argparse.Namespace:
    """Return the options of the command line, each of its default's type; `text` is the docstring of the bench."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in defaults.items():
        parser.add_argument(f"--{name}", type=type(default), default=default, help=f"default: {default}")
    return parser.parse_args()


def run_parts(**parts: Callable[[], None]) -> None:
    """Run the parts that the command line names, or all."""
    names = sys.argv[1:] or list(parts)
    if unknown := set(names) - set(parts):
        sys.exit(f"no part {', '.join(sorted(unknown))}; there are {', '.join(parts)}")
    for name in names:
        parts[name]()


def machine() -> str:
    """Return one line on processor, cores, load, system and versions."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [row.partition(":")[2].strip() for row in cpuinfo.read_text().splitlines() if "model name" in row]
        model = names[0] if names else model
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("eclipse-zenoh", "numba", "msgspec"))
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{model}, {os.cpu_count()} cores, load {load()}; {system}, {versions}"


def load() -> str:
    """Return the load of the machine over 1, 5 and 15 minutes."""
    return ", ".join(f"{value:.1f}" for value in os.getloadavg())


def say(text: str) -> None:
    """Show progress."""
    print(f"{text} ...", file=sys.stderr, flush=True)


def ratios(rivals: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, float]:
    """Measure rivals round by round, print their times (s) and ratios, and return the median ratios.

    The first rival is the reference: it runs before and after the others, whose order changes from round to round. A
    ratio is that of a time to the reference's in the same round, so that it holds whatever else the machine does.
    """
    (first, reference), *others = rivals.items()
    times: dict[str, list[float]] = {name: [] for name in rivals}
    ratios_by_rival: dict[str, list[float]] = {name: [] for name, _ in others}
    for i in range(rounds):
        before = reference()
        k = i % max(len(others), 1)
        took = {name: run() for name, run in others[k:] + others[:k]}
        after = reference()
        times[first] += [before, after]
        for name, seconds in took.items():
            times[name].append(seconds)
            ratios_by_rival[name].append(2.0 * seconds / (before + after))
    print(f"{'':48}{'median (s)':>11}{'fastest (s)':>13}   ratio (lowest to highest)")
    for name, values in times.items():
        line = f"{name:48}{median(values):11.3f}{min(values):13.3f}"
        if of := ratios_by_rival.get(name):
            line += f"   {median(of):.3f} ({min(of):.3f} to {max(of):.3f})"
        print(line)
    return {name: median(values) for name, values in ratios_by_rival.items()}


def cells(row: Mapping[str, float | None], *names: str) -> str:
    """Return values of a row of a sweep, with 3 digits; "never" for a time that does not exist.

    Examples
    --------
    >>> cells({"f": 0.7512, "P": None}, "f", "P")
    '0.751 / never'
    """
    values = (row[name] for name in names)
    return " / ".join("never" if x is None or math.isnan(x) else f"{x:.3g}" for x in values)
