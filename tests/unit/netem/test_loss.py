"""Losses, duplicates and flipped bits: realised against configured."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from gridpeers.netem.draws import RESTART, Chain, Stream
from gridpeers.netem.models.loss import Bernoulli, GilbertElliott, LossModel, Markov
from gridpeers.netem.models.medium import Corrupt, flip
from tests.unit.netem.link_messages import channel, fates, steady

N = 20_000


PATTERNS = {
    "gilbert": GilbertElliott(p=0.2, r=0.4),
    "alternating": GilbertElliott(p=1.0, r=1.0),
    "gilbert-elliott": GilbertElliott(p=0.1, r=0.3, loss_good=0.1, loss_bad=0.7),
    "markov": Markov(p13=0.2, p31=0.3, p32=0.3, p23=0.4, p14=0.1),
}

share = st.floats(0.0, 1.0)


def lost(model: LossModel, n: int = N) -> list[bool]:
    return [fate.reason == "loss" for fate in fates(channel(loss=model), range(n))]


@pytest.mark.parametrize("p", [0.001, 0.02, 0.5, 0.9])
def test_independent_losses_are_as_frequent_as_configured(p: float) -> None:
    """A binomial test accepts probability p, and a run test accepts independence."""
    drawn = lost(Bernoulli(p=p))
    pairs = Counter(pairwise(drawn))

    assert stats.binomtest(sum(drawn), N, p).pvalue > 0.01
    assert stats.binomtest(pairs[True, True], sum(drawn[:-1]), p).pvalue > 0.01


@pytest.mark.parametrize("name", PATTERNS)
def test_patterns_of_losses_have_the_probabilities_of_the_chain(name: str) -> None:
    """Over 8000 seeds, each pattern of six messages, also across a restart of the chain, has its frequency."""
    model, numbers = PATTERNS[name], (0, 1, 3, RESTART, RESTART + 1, RESTART + 3)
    drawn: Counter[tuple[bool, ...]] = Counter()
    for seed in range(8000):
        is_lost = model.sampler(Stream(seed, "inv1", "inv2", "loss"))
        drawn[tuple(map(is_lost, numbers))] += 1
    expected = {pattern: probability(model, numbers, pattern) for pattern in product((False, True), repeat=6)}
    often = [pattern for pattern, share in expected.items() if share * 8000 >= 5.0]
    shares = [expected[pattern] for pattern in often]
    counts = [drawn[pattern] for pattern in often]

    assert sum(expected.values()) == pytest.approx(1.0)
    assert drawn.keys() <= {pattern for pattern, share in expected.items() if share > 0.0}
    observed, told = [*counts, 8000 - sum(counts)], [8000 * share for share in (*shares, 1.0 - sum(shares))]
    assert (
        stats.chisquare(*zip(*((o, e) for o, e in zip(observed, told, strict=True) if e > 1e-6), strict=True)).pvalue
        > 0.01
    )


def probability(model: LossModel, numbers: Sequence[int], lost: Sequence[bool]) -> float:
    """Probability of one pattern of losses, message by message along the chain."""
    P, pi, loss = np.array(model.transitions), np.array(model.stationary), np.array(model.loss_in_state)
    state, before = pi, None
    for number, is_lost in zip(numbers, lost, strict=True):
        if before is not None:
            same = number // RESTART == before // RESTART
            state = state @ np.linalg.matrix_power(P, number - before) if same else state.sum() * pi
        state, before = state * (loss if is_lost else 1.0 - loss), number
    return float(state.sum())


@steady
@given(st.integers(0, 20), st.floats(0.0, 0.9), st.floats(0.0, 0.1))
def test_messages_lost_at_a_lower_probability_are_lost_at_a_higher_one(seed: int, p: float, more: float) -> None:
    """The random number of a message does not depend on the probability, so sweeps over loss compare like with like."""
    low = fates(channel(seed, loss=p), range(200))
    high = fates(channel(seed, loss=p + more), range(200))

    assert {i for i, fate in enumerate(low) if fate.reason} <= {i for i, fate in enumerate(high) if fate.reason}


def test_corruption_flips_every_bit_with_equal_probability() -> None:
    bits = [fate.deliveries[0][1] for fate in fates(channel(corrupt=Corrupt(p=0.2)), range(N), size=4)]
    flipped = Counter(bit for bit in bits if bit is not None)

    assert stats.binomtest(flipped.total(), N, 0.2).pvalue > 0.01
    assert stats.chisquare([flipped[bit] for bit in range(32)]).pvalue > 0.01


@steady
@given(st.binary(min_size=1, max_size=40), st.data())
def test_a_flip_changes_one_bit_and_a_second_flip_restores_it(payload: bytes, data: st.DataObject) -> None:
    """A flipped payload differs in exactly one bit."""
    bit = data.draw(st.integers(0, 8 * len(payload) - 1))
    flipped = flip(payload, bit)

    assert sum((one ^ other).bit_count() for one, other in zip(payload, flipped, strict=True)) == 1
    assert flip(flipped, bit) == payload


def test_numbers_are_uniform_normal_and_independent_from_one_to_the_next() -> None:
    """The draws behind all models have their distribution along the messages of a link."""
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
def test_the_state_of_a_chain_depends_only_on_the_message_number(numbers: list[int]) -> None:
    """A receiver that missed messages or joined late has the same state as one that saw them all."""
    uniform = Stream(1, "a", "b", "x").uniform
    jumping = Chain(uniform, lambda x, seq: 0.9 * x + uniform(seq))

    def walked(seq: int) -> float:
        x = uniform(seq - seq % RESTART)
        for number in range(seq - seq % RESTART + 1, seq + 1):
            x = 0.9 * x + uniform(number)
        return x

    assert [jumping.at(seq) for seq in numbers] == [walked(seq) for seq in numbers]
