from __future__ import annotations

import math
import random

import pytest

from gridpeers.agents.tick_timer import EARLIEST, LATEST, TickTimer

T = 0.020


def phases(timer: TickTimer, first: float, count: int, *, drift: float = 0.0, jitter: float = 0.0) -> list[float]:
    rng, seen, k = random.Random(1), [], 0
    at = first
    while len(seen) < count:
        if at <= timer.due:
            timer.measured(at)
            k += 1
            at = first + k * T * (1.0 + drift) + rng.uniform(0.0, jitter)
        else:
            now = timer.due
            timer.take(now)
            seen.append(math.fmod(now - first, T * (1.0 + drift)) / T)
    return seen


@pytest.mark.parametrize("offset", [i / 16 for i in range(1, 17)])
def test_from_the_second_tick_on_an_agent_keeps_to_the_middle_between_two_measurements(offset: float) -> None:
    """It ticks exactly once a period, from any start within the period."""
    timer = TickTimer(T)
    timer.start(5.0)
    seen = phases(timer, 5.0 - offset * T, 200)

    assert all(EARLIEST - 1e-6 <= phase <= LATEST + 1e-6 for phase in seen[1:])
    assert 5.0 + 198.4 * T <= timer.due - T <= 5.0 + 199.6 * T


def test_a_clock_that_drifts_against_the_plants_is_led_back_to_the_middle() -> None:
    """50 ppm of drift and a few milliseconds of jitter bring no tick to the time at which measurements come."""
    timer = TickTimer(T)
    timer.start(5.0)
    seen = phases(timer, 4.995, 20_000, drift=5e-5, jitter=0.003)

    assert min(seen[1:]) > EARLIEST - 0.05
    assert max(seen[1:]) < LATEST + 0.20
    assert max(seen[1:]) - min(seen[1:]) > 0.2, "it drifts"


def test_an_emulated_drift_is_not_corrected() -> None:
    timer = TickTimer(T, keeps_clear=False)
    timer.start(5.0)
    seen = phases(timer, 4.999, 3000, drift=1e-3)

    assert min(seen) < 0.05
    assert max(seen) > 0.95
