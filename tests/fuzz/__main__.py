"""Fuzz everything that takes bytes, and print the rate and what came of it: ``python -m tests.fuzz [1000000]``."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from time import perf_counter

from tests.fuzz.fuzzing import SEED, fuzz


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=1_000_000, help="number of messages")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of the messages (default {SEED})")
    given = parser.parse_args()
    began = perf_counter()
    outcomes, ways = fuzz(given.count, given.seed, lambda done: print(f"{done} ...", file=sys.stderr, flush=True))
    took = perf_counter() - began
    rate = f"{took:.0f} s, {given.count / took:.0f} a second"
    print(f"{given.count} messages of seed {given.seed} ({rate}): no uncaught error")
    print("made: " + ", ".join(f"{way} {number}" for way, number in ways.most_common()))
    of: dict[str, Counter[str]] = {}
    for (name, kind), number in outcomes.items():
        of.setdefault(name, Counter())[kind or "used"] = number
    for name, kinds in of.items():
        print(f"{name:26}" + ", ".join(f"{kind} {number}" for kind, number in kinds.most_common()))


if __name__ == "__main__":
    main()
