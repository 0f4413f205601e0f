"""Measure how long a cut between hosts takes to heal, and whether agents that were not cut off notice it.

Two hosts (network namespaces): the plant and six agents of the paper's feeder on one, three on the other. The other is
cut off for 1.7 to 3.2 s, again and again: around the 2 s after which Zenoh gives a silent link up, the worst time to
heal, as one end may have given up and the other not.

    .venv/bin/python -m bench.heal [--repeat 40] [--seed 1]
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
from collections.abc import Iterable
from itertools import permutations
from pathlib import Path
from time import monotonic

from bench.harness import load, machine, say
from bench.latency import two_hosts
from bench.run_observer import NotInTimeError, RunObserver, describe
from scenarios.drivers.free_endpoint import free_endpoint
from tests.processes.hosts import Hosts

AWAY = ("inv7", "inv8", "inv9")
"""Agents on the other host: one grid-forming, two grid-following."""

SHORTEST, LONGEST = 1.7, 3.2
"""Of a cut (s)."""

REST = (0.5, 1.5)
"""Time (s) between a heal and the next cut."""

PATIENCE = 60.0
"""Longest wait (s) for a heal."""

DEAF = 8.0
"""Time (s) without a heal after which this program asks itself whether its own session still hears everybody."""

LEGEND = """
healed     healing -> every agent has all eight others in its sums, as their AgentStatus tell
noticed    cuts in which one of the six who were not cut off lost another of the six from its sums
sessions   new sessions that agents opened, as a link had not been made anew on both sides
deaf       cuts after which this program's own session did not hear a running agent any more: not counted above"""


def wait(observer: RunObserver, seconds: float) -> None:
    """Take in what comes for so long."""
    end = monotonic() + seconds
    observer.until(lambda: monotonic() >= end, "time goes by", seconds + 1.0)


def sessions(logs: Path) -> int:
    """Return how often agents said that they open a new session."""
    return sum(path.read_text().count("opens a new session") for path in logs.glob("inv*.log"))


def noticed(observer: RunObserver, here: Iterable[str]) -> bool:
    """Whether, since `mark`, anybody who was not cut off went out of the sums of another."""
    pairs = set(permutations(here, 2))
    return any((who, whom) in pairs and not into for _, who, whom, into in observer.turns)


def healed(observer: RunObserver) -> bool:
    """Wait for a heal; whether this program heard everybody meanwhile."""
    try:
        observer.all_use(*observer.names, patience=DEAF)
    except NotInTimeError:
        if observer.listen_again():
            observer.all_use(*observer.names, patience=PATIENCE)
            return False
        observer.all_use(*observer.names, patience=PATIENCE - DEAF)
    return True


def measure(observer: RunObserver, hosts: Hosts, repeat: int, rng: random.Random) -> tuple[list[float], int, int]:
    """Return times (s) of so many heals, in how many cuts the others noticed, and how often this program was deaf."""
    here = [name for name in observer.names if name not in AWAY]
    took, disturbed, deaf = [], 0, 0
    for i in range(repeat):
        observer.mark(observer.names)
        cut = rng.uniform(SHORTEST, LONGEST)
        hosts.cut(2)
        wait(observer, cut)
        hosts.heal(2)
        began = monotonic()
        if healed(observer):
            took.append(max(at for at, *_ in observer.turns) - began)
            disturbed += noticed(observer, here)
            say(f"{i + 1} of {repeat}: cut for {cut:.2f} s, healed after {took[-1]:.2f} s")
        else:
            deaf += 1
            say(f"{i + 1} of {repeat}: cut for {cut:.2f} s; this program's own session was deaf")
        wait(observer, rng.uniform(*REST))
    return took, disturbed, deaf


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--repeat", type=int, default=40, help="how many cuts")
    parser.add_argument("--seed", type=int, default=1, help="of how long they last")
    arguments = parser.parse_args()
    print(machine())
    print(f"load (1, 5, 15 min) before {load()}")
    with tempfile.TemporaryDirectory() as folder, two_hosts() as hosts:
        if hosts is None:
            return 1
        listen = f"tcp/{hosts.address(1)}:0"
        elsewhere = {name: (f"tcp/{hosts.address(2)}:0", hosts.at(2)) for name in AWAY}
        observer = RunObserver(Path(folder), free_endpoint(listen), listen, elsewhere)
        say("the run starts")
        with observer:
            took, disturbed, deaf = measure(observer, hosts, arguments.repeat, random.Random(arguments.seed))
        new_sessions = sessions(Path(folder))
    print(f"\n{'(ms)':40}{'n':>6} {'p50':>9} {'p95':>9} {'max':>9}")
    print(f"{'healed':40}{describe(took)}")
    print(f"{'noticed by the others':40}{disturbed:6}")
    print(f"{'new sessions':40}{new_sessions:6}")
    print(f"{'deaf':40}{deaf:6}")
    print(LEGEND)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except NotInTimeError as error:
        sys.exit(str(error))
