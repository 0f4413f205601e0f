from __future__ import annotations

from functools import partial

import pytest
from scipy.stats import binom, kstest

from netem.draws import Stream
from netem.relay.direction import Direction, Faults, FaultsError
from netem.relay.line import ImpairedLine
from netem.relay.packets import NEVER, Datagrams

N = 4000
SURE = 1e-4
"""Chance that a sound link would fail a test, were the seed not fixed."""


def carried(faults: Faults, count: int = N, gap: float = 1.0, *, size: int = 4, seed: int = 1) -> dict[int, float]:
    """Delay of each datagram that arrived, in the order of arrival."""
    direction, delays = Direction("there", faults), {}
    line = ImpairedLine(direction, Datagrams(partial(Stream, seed, "1", "there"), direction))

    def take(now: float) -> None:
        for data in line.take(now):
            number = int.from_bytes(data[:4], "big")
            delays[number] = now - number * gap

    for number in range(count):
        while line.until <= number * gap:
            take(line.until)
        line.send(number.to_bytes(4, "big") + bytes(size - 4), number * gap)
    while line.until < NEVER:
        take(line.until)
    return delays


def test_datagrams_are_lost_as_often_as_told() -> None:
    """The number of lost datagrams is one that the binomial law gives."""
    lost = N - len(carried(Faults(loss=0.02)))

    assert binom.ppf(SURE / 2, N, 0.02) <= lost <= binom.isf(SURE / 2, N, 0.02)


def test_delays_are_uniform_about_the_mean() -> None:
    """Delays follow the uniform law of delay and jitter (Kolmogorov-Smirnov)."""
    delays = list(carried(Faults(delay=0.3, jitter=0.1)).values())

    assert kstest(delays, "uniform", args=(0.2, 0.2)).pvalue > SURE


def test_the_fate_of_a_datagram_depends_on_its_number_alone() -> None:
    """Other times and sizes, the same datagrams lost; another seed, others."""
    faults = Faults(delay=0.1, jitter=0.1, loss=0.2)
    first, slower = carried(faults, 300), carried(faults, 300, 0.01, size=900)

    assert sorted(first) == sorted(slower)
    assert sorted(first) != sorted(carried(faults, 300, seed=2))


def test_reordered_datagrams_skip_the_delay() -> None:
    """The configured part of the messages arrives at once, before messages sent earlier."""
    delays = carried(Faults(delay=2.5, reorder=0.25), gap=1.0)
    early = sum(delay == 0.0 for delay in delays.values())

    assert binom.ppf(SURE / 2, N, 0.25) <= early <= binom.isf(SURE / 2, N, 0.25)
    assert list(delays) != sorted(delays)
    assert len(delays) == N


def test_a_full_queue_drops_what_comes_and_the_rate_is_kept() -> None:
    """Offered twice the rate, half gets through, and none waits longer than the queue is long."""
    faults = Faults(rate=1000.0, queue=2000)
    delays = carried(faults, 1000, 0.05, size=100)

    assert 1000 * 0.5 <= len(delays) <= 1000 * 0.5 + 2000 / 100
    assert max(delays.values()) == pytest.approx(2000 / 1000.0, abs=0.11)


@pytest.mark.parametrize(
    ("values", "complaint"),
    [
        ({"delay": -0.1}, r"delay: a delay must not be negative, got -0.1 s"),
        ({"delay": 100.0}, r"did you mean 0.1 \(100 ms\)\?"),
        ({"loss": 2.0}, r"did you mean 0.02 \(2 %\)\?"),
        ({"delay": float("nan")}, "delay: a delay must be a finite number"),
        ({"queue": float("nan")}, "queue: a queue must be a finite number"),
        ({"jitter": 0.1}, "nothing arrives early"),
        ({"reorder": 0.1}, "needs a delay"),
        ({"rate": -1.0, "loss": -1.0}, "(?s)loss: .*rate: "),
    ],
)
def test_values_that_cannot_be_meant_are_refused(values: dict[str, float], complaint: str) -> None:
    """Milliseconds, percents and the impossible are named, all at once, with what would be right."""
    with pytest.raises(FaultsError, match=complaint):
        Faults(**values)
