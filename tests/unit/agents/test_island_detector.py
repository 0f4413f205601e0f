from __future__ import annotations

import random
from itertools import pairwise
from math import sin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.agents.degraded_communication import LONGEST_RETRY, IslandDetector

T, F_NOM, SLIP_MAX = 0.02, 60.0, 0.01


def pair(slip_max: float = SLIP_MAX) -> tuple[IslandDetector, IslandDetector]:
    return IslandDetector(F_NOM, slip_max), IslandDetector(F_NOM, slip_max)


@given(st.integers(0, 10_000))
def test_within_one_island_no_agent_is_apart_even_with_lost_and_late_messages(seed: int) -> None:
    """Frequency swings by 2 Hz, the angle between them by 3 degrees; nine of ten states are lost, all are late."""
    rng = random.Random(seed)
    here, there = pair()
    frequency = [60.0 + sum(a * sin(w * k * T) for a, w in ((0.6, 1.3), (0.4, 9.0))) for k in range(500)]
    swing = [0.0045 * sin(3.0 * k * T) for k in range(501)]  # cycles
    loss, late = rng.choice((0.0, 0.5, 0.9)), rng.randrange(30)
    sent = []
    for k, f in enumerate(frequency):
        here.sensed(k * T, f)
        there.sensed(k * T, f + (swing[k + 1] - swing[k]) / T)
        sent.append((k * T, there.angle))
        if k >= late and rng.random() >= loss:
            here.heard("inv4", *sent[k - late])
        assert not here.apart("inv4", k * T), k


@pytest.mark.parametrize("difference", [0.5, 0.05, -0.01])
def test_another_frequency_is_seen_as_soon_as_the_slip_is_too_large(difference: float) -> None:
    """A constant difference takes slip_max / difference, a little more as slip is forgotten."""
    here, there = pair()
    k = 0
    while not here.apart("inv4", k * T):
        k += 1
        here.sensed(k * T, 60.0)
        there.sensed(k * T, 60.0 + difference)
        here.heard("inv4", k * T, there.angle)

    assert SLIP_MAX / abs(difference) <= k * T <= 1.1 * SLIP_MAX / abs(difference) + 3 * T


def test_an_agent_apart_is_tried_again_ever_more_rarely() -> None:
    """After 10 s, then 20 s and so on up to ten minutes, as long as it does not stay in step."""
    here, there = pair()
    left, was_apart = [], False
    for k in range(150_000):
        t = 0.1 * k
        here.sensed(t, 60.0)
        there.sensed(t, 60.1)
        here.heard("inv4", t, there.angle)
        apart = here.apart("inv4", t)
        if apart and not was_apart:
            left.append(t)
        was_apart = apart

    gaps = [b - a for a, b in pairwise(left)]
    assert gaps[:7] == pytest.approx([10, 20, 40, 80, 160, 320, 600], abs=1.0)
    assert gaps[-1] == pytest.approx(LONGEST_RETRY, abs=1.0)
