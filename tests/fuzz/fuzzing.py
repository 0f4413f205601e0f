"""Give made-up messages to everything that takes bytes, and count how each is refused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from tests.fuzz.mutation import Mutation
from tests.fuzz.receivers import receivers

SEED = 16
"""Seed of the command and of the test."""


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
