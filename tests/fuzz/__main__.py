"""Give made-up messages to everything that takes bytes, and print the rate and how each was refused.

Usage: ``python -m tests.fuzz [1000000]``
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable
from time import perf_counter

from tests.fuzz.mutation import Mutation
from tests.fuzz.receivers import receivers

SEED = 16  # Seed of the command and of the test


class FuzzError(AssertionError):
    """A message raised an error; the text has its number, bytes, receiver and seed."""


def fuzz(
    count: int, seed: int = SEED, progress: Callable[[int], None] = lambda done: None
) -> tuple[Counter[tuple[str, str]], Counter[str]]:
    """Make messages and give each to the codec and to one other receiver; call `progress` every ten thousand.

    Return the messages by receiver and kind of rejection, "" for those that were used, and by the way in which they
    were made. Raise FuzzError if one raises an error that its receiver does not have for bad input.
    """
    targets = receivers()
    mutation = Mutation(seed)
    codec, others = "codec", [name for name in targets if name != "codec"]
    outcomes: Counter[tuple[str, str]] = Counter()
    ways: Counter[str] = Counter()
    for number in range(count):
        made = mutation.make()
        ways[made.way] += 1
        for name in (codec, mutation.rng.choice(others)):
            try:
                outcomes[name, targets[name].take(made.payload, mutation.rng)] += 1
            except Exception as error:
                raise FuzzError(
                    f"message {number} of seed {seed} ({made.way}), {name}: {type(error).__name__}: {error}; "
                    f"{made.payload[:300]!r}"
                ) from error
        if number % 10_000 == 0:
            progress(number)
    return outcomes, ways


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description="Fuzz all that takes bytes.")
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
