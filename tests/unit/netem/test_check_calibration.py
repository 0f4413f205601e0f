"""The self-check's promise: one sound run in a thousand has a warning, whatever its links do, however short it is."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy import stats

from netem.check.count_law import COUNTED, blocks, law, mean
from netem.check.fault_checks import count_bursts
from netem.models.chain import RESTART
from netem.models.delay import Lognormal, Uniform
from netem.models.loss import GilbertElliott, LossModel, Markov
from netem.schema.pattern import Link
from tests.unit.netem.netem_runs import ALL, all_links, checked, family, sound, traced, warned

CHAINS = {
    "gilbert": GilbertElliott(p=0.2, r=0.4),
    "alternating": GilbertElliott(p=1.0, r=1.0),
    "gilbert-elliott": GilbertElliott(p=0.1, r=0.3, loss_good=0.1, loss_bad=0.7),
    "markov": Markov(p13=0.2, p31=0.3, p32=0.3, p23=0.4, p14=0.1),
    "never": GilbertElliott(p=0.0, r=0.5),
}

LINK = (Link("inv1", "inv2"),)

SOME = np.array([RESTART - 6, RESTART - 5, RESTART - 4, RESTART - 1, RESTART, RESTART + 1, RESTART + 2, RESTART + 4])
"""Numbers of messages with gaps, over a start of the chain."""


RUNS = ((60, 24), (450, 12))
"""Messages a run, and runs of each kind, each with a seed, and so draws, of its own."""


def probability(model: LossModel, seq: np.ndarray, lost: np.ndarray) -> float:
    """Probability of one pattern of losses, by going along the chain message by message."""
    P, pi, loss = np.array(model.transitions), np.array(model.stationary), np.array(model.loss_in_state)
    state, fates = pi, dict(zip(seq.tolist(), lost.tolist(), strict=True))
    for number in range(int(seq[0]), int(seq[-1]) + 1):
        if number > seq[0]:
            state = state.sum() * pi if number % RESTART == 0 else state @ P
        if number in fates:
            state = state * (loss if fates[number] else 1.0 - loss)
    return float(state.sum())


@pytest.mark.parametrize("name", CHAINS)
def test_the_law_of_a_count_is_the_sum_over_all_patterns(name: str) -> None:
    """Losses, bursts and single losses have the probabilities that all 256 patterns of eight messages add up to."""
    model, n = CHAINS[name], len(SOME)
    expected = {counted: np.zeros(n + 1) for counted in COUNTED}
    for pattern in product((False, True), repeat=n):
        lost = np.array(pattern)
        share = probability(model, SOME, lost)
        begun, alone = count_bursts(SOME, lost)
        for counted, found in (("losses", lost.sum()), ("bursts", begun), ("single", alone)):
            expected[counted][found] += share

    for counted, values in expected.items():
        first, found = law(counted, model, blocks(SOME))
        assert first == 0
        assert found == pytest.approx(values, abs=1e-13)


@pytest.mark.parametrize("name", ["gilbert", "gilbert-elliott", "markov"])
def test_the_law_of_a_long_run_is_that_of_its_parts_together(name: str) -> None:
    """Where the law is only given around its mean it is the convolution of the laws of the stretches between starts."""
    model = CHAINS[name]
    first, found = law("losses", model, blocks(np.arange(10 * RESTART)))
    _, of_one = law("losses", model, blocks(np.arange(RESTART)))
    whole = np.fft.irfft(np.fft.rfft(of_one, 16 * RESTART) ** 10, 16 * RESTART)

    assert 0 < first < mean(first, found) < first + len(found) < 10 * RESTART
    assert found == pytest.approx(whole[first : first + len(found)], abs=1e-12)
    assert found.sum() == pytest.approx(1.0, abs=1e-10)


def test_profile_lte_over_72_links_is_no_reason_for_a_warning() -> None:
    """Rare bursts (p = 0.0005) over 450 messages a link, and five bits of luck on one link: chance, not a defect."""
    assert [warned(sound(ALL["lte"], 450, seed, all_links())) for seed in range(3)] == [False] * 3


def test_sound_runs_of_any_kind_and_length_are_warned_of_no_more_often_than_promised() -> None:
    """Of 860 runs at most as many are below any level as the level says, over all kinds together and of each."""
    found = {
        kind: np.array([family(sound(done, n, 1000 * i + seed)) for n, runs in RUNS for seed in range(runs)])
        for i, (kind, done) in enumerate(ALL.items())
    }

    for level in (0.001, 0.01, 0.05, 0.2):
        for values in found.values():
            assert stats.binomtest(int((values <= level).sum()), len(values), level, "greater").pvalue > 1e-4
        values = np.concatenate([*found.values()])
        assert stats.binomtest(int((values <= level).sum()), len(values), level, "greater").pvalue > 0.001


FALSE = {
    "13 % lost instead of 10 %": ({"loss": 0.13}, {"loss": 0.1}, 5000, "loss"),
    "bursts twice as long": (
        {"loss": GilbertElliott(p=0.01, r=0.2)},
        {"loss": GilbertElliott(p=0.02, r=0.4)},
        5000,
        "bursts",
    ),
    "bursts where single losses were told": (
        {"loss": GilbertElliott(p=0.03, r=0.3)},
        {"loss": Markov(p13=0.0, p31=0.3, p14=0.1)},
        1000,
        "bursts of one message",
    ),
    "rare bursts ten times as often": (
        {"loss": GilbertElliott(p=0.005, r=0.25)},
        {"profile": "lte"},
        5000,
        "loss",
    ),
    "1 ms later": (
        {"delay": Uniform(low_s=0.011, high_s=0.021)},
        {"delay": Uniform(low_s=0.01, high_s=0.02)},
        1000,
        "delay",
    ),
    "correlation 0.5 instead of 0.8": (
        {"delay": Lognormal(median_s=0.02, sigma=0.5, correlation=0.5)},
        {"delay": Lognormal(median_s=0.02, sigma=0.5, correlation=0.8)},
        450,
        "delay correlation",
    ),
}


@pytest.mark.parametrize("name", FALSE)
def test_a_falsified_link_is_caught_whatever_the_seed(name: str) -> None:
    """A link that does otherwise than its law says is found in every one of ten runs, with the property that is off."""
    done, told, n, what = FALSE[name]

    for seed in range(10):
        assert what in {row.what for row in checked(traced(done, n, seed, LINK), told, seed).rows if row.ok is False}


def test_one_falsified_link_of_72_is_the_only_one_that_is_named() -> None:
    """Holm's method over 216 tests leaves enough to find a link that loses a fifth where a tenth was told."""
    told, done = ({"loss": GilbertElliott(p=p, r=0.5)} for p in (0.05, 0.125))
    links = set(all_links()) - set(LINK)
    found = checked([*traced(told, 450, 3, links), *traced(done, 450, 3, LINK)], told, 3)

    assert {(row.src, row.dst) for row in found.rows if row.ok is False} == set(LINK)
