"""A bounded part of ``python -m tests.fuzz``, which gives a million made-up messages to all that takes bytes."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from gridpeers.wire.codec import KINDS
from tests.fuzz import fuzzing
from tests.fuzz.fuzzing import FuzzError, fuzz
from tests.fuzz.mutation import Mutation
from tests.fuzz.receivers import receivers


def test_no_bytes_raise_an_error_that_nobody_expects(tmp_path: Path) -> None:
    """Random, changed, cut, nested and misaddressed ones: each is used, or refused by its kind."""
    outcomes, ways = fuzz(1_500)
    kinds = {kind for name, kind in outcomes if name == "codec"}

    assert min(ways.values()) > 15
    assert {"", "corrupt", "garbled", "unknown", "implausible", "oversized"} - kinds <= {"oversized"}
    assert {name for name, _ in outcomes} == set(receivers())
    for name in {name for name, _ in outcomes}:
        assert sum(count for (to, kind), count in outcomes.items() if to == name and kind) > 30, name
    assert {kind for name, kind in outcomes if "agent" in name or "plant" in name} <= {"", *KINDS} - {"failed"}


def test_an_error_is_told_with_the_bytes_that_raised_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A receiver that fails ends the fuzzing with number, seed and bytes of the message, so that it can be repeated."""

    class Weak:
        def take(self, payload: bytes, rng: random.Random) -> str:
            return str(payload[40])

    monkeypatch.setattr(fuzzing, "receivers", lambda: {"codec": Weak(), "weak": Weak()})
    with pytest.raises(FuzzError, match=r"message \d+ of seed 5 \(.*\), codec: IndexError: .*; b'"):
        fuzz(1_000, seed=5)


def test_a_seed_makes_the_same_messages() -> None:
    """So what was found once is found again."""
    first, again, other = Mutation(3), Mutation(3), Mutation(4)
    made = [first.make() for _ in range(200)]

    assert made == [again.make() for _ in range(200)]
    assert made != [other.make() for _ in range(200)]
