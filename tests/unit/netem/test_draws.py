"""Numbers that are looked up by link, purpose and message."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gridpeers.netem.draws import RESTART, Chain, Stream
from tests.unit.netem.link_messages import steady

N = 20_000


def test_numbers_lie_strictly_between_zero_and_one() -> None:
    """Inverse distribution functions are finite at every number that can be drawn."""
    numbers = [Stream(3, "inv1", "inv2", "loss").uniform(seq) for seq in range(N)]

    assert min(numbers) > 0.0
    assert max(numbers) < 1.0


def test_numbers_are_uniform_normal_and_independent_from_one_to_the_next() -> None:
    """The draws that the laws are made of have the distribution they claim, along the messages of a link."""
    stream = Stream(3, "inv1", "inv2", "loss")
    uniform = [stream.uniform(seq) for seq in range(N)]
    normal = [stream.normal(seq, 1) for seq in range(N)]

    assert stats.kstest(uniform, "uniform").pvalue > 0.01
    assert stats.kstest(normal, "norm").pvalue > 0.01
    assert abs(stats.pearsonr(uniform[1:], uniform[:-1]).statistic) < 3 / math.sqrt(N)
    assert abs(stats.pearsonr(uniform, normal).statistic) < 3 / math.sqrt(N)


@steady
@given(st.lists(st.tuples(*[st.text(max_size=4)] * 3, st.integers(0, 3)), min_size=2, max_size=6, unique=True))
def test_every_seed_link_and_purpose_has_numbers_of_its_own(keys: list[tuple[str, str, str, int]]) -> None:
    """No two streams share a number, whatever the names, even where their letters run together."""
    numbers = [Stream(seed, src, dst, purpose).uniform(5) for src, dst, purpose, seed in keys]

    assert len(set(numbers)) == len(keys)


@steady
@given(st.lists(st.integers(0, 3 * RESTART), min_size=1, max_size=5))
def test_a_chains_state_depends_on_the_number_and_not_on_what_was_asked_before(numbers: list[int]) -> None:
    """A receiver that missed messages, or joined late, is in the state of one that saw them all."""
    uniform = Stream(1, "a", "b", "x").uniform
    jumping = Chain(uniform, lambda x, seq: 0.9 * x + uniform(seq))

    def walked(seq: int) -> float:
        x = uniform(seq - seq % RESTART)
        for number in range(seq - seq % RESTART + 1, seq + 1):
            x = 0.9 * x + uniform(number)
        return x

    assert [jumping.at(seq) for seq in numbers] == [walked(seq) for seq in numbers]
