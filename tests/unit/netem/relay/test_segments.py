from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from netem.draws import Stream
from netem.relay.direction import Direction, Faults
from netem.relay.packets import NEVER, Bottleneck, Packet
from netem.relay.segments import RTO_MIN, Segments

DELAYS = st.floats(0.0, 1.0)
GAPS = st.lists(st.floats(0.0, 0.5), min_size=1, max_size=40)


class Chosen(Stream):
    """Numbers that lose the transmissions named (segment, turn), and no other; every delay is the mean."""

    def __init__(self, *lost: tuple[int, int]) -> None:
        super().__init__(0, "", "", "")
        self._lost = lost

    def __call__(self, purpose: str) -> Stream:
        """The numbers of a purpose."""
        return self if purpose == "loss" else Chosen()

    def uniform(self, seq: int, index: int = 0) -> float:
        """Number for one transmission."""
        return 0.0 if (seq, index) in self._lost else 0.5


def streams(seed: int) -> Callable[[str], Stream]:
    """The random numbers of a direction."""
    return partial(Stream, seed, "1", "there")


def line_of(stream: Callable[[str], Stream], there: Faults, back: Faults) -> Segments:
    """A direction with these faults, and others on the way back."""
    return Segments(stream, Direction("there", there), Direction("back", back))


def carried(line: Segments, sent: list[float]) -> list[float]:
    """When each segment, sent at these times, is handed over."""
    numbers: dict[int, float] = {}

    def take(now: float) -> None:
        numbers.update((int.from_bytes(data, "big"), now) for data in line.take(now))

    for number, at in enumerate(sent):
        while line.until <= at:
            take(line.until)
        line.send(Packet(number + 1, number.to_bytes(2, "big")), at)
    while line.until < NEVER:
        take(line.until)
    assert list(numbers) == list(range(len(sent))), "all of them, in order"
    return list(numbers.values())


@given(delay=DELAYS, back=DELAYS, jitter=st.floats(0.0, 1.0), loss=st.floats(0.0, 0.6), gaps=GAPS, seed=st.integers())
def test_tcp_loses_nothing_and_keeps_the_order(
    delay: float, back: float, jitter: float, loss: float, gaps: list[float], seed: int
) -> None:
    """All bytes come, in order, none before the shortest delay; without loss, none late."""
    faults = Faults(delay=delay, jitter=jitter * delay, loss=loss)
    sent = [sum(gaps[: n + 1]) for n in range(len(gaps))]

    lossy = carried(line_of(streams(seed), faults, Faults(delay=back)), sent)
    sound = carried(line_of(streams(seed), Faults(delay=delay), Faults(delay=back)), sent)

    assert all(a <= b for a, b in pairwise(lossy))
    shortest = delay - jitter * delay
    assert all(came >= at + shortest - 1e-9 for at, came in zip(sent, lossy, strict=True))
    assert sound == pytest.approx([at + delay for at in sent])


@given(delay=DELAYS, back=DELAYS, gap=st.floats(0.001, 2.0))
def test_a_lost_segment_comes_after_fast_retransmit_or_the_time_out_whichever_is_first(
    delay: float, back: float, gap: float
) -> None:
    """One loss costs the gap to the next segment, a round trip and a quarter, or RTO; those behind wait for it."""
    R = delay + back
    line = line_of(Chosen((2, 1)), Faults(delay=delay, loss=0.5), Faults(delay=back))

    came = carried(line, [0.0, gap, 2.0 * gap, 3.0 * gap])

    again = gap + min(gap + 1.25 * R, R + RTO_MIN)
    assert came == pytest.approx(
        [delay, again + delay, max(2.0 * gap, again) + delay, max(3.0 * gap, again) + delay], abs=1e-9
    )


def test_the_last_segment_of_all_waits_for_time_outs_that_double() -> None:
    """With nothing behind it to tell of its loss, a segment lost three times comes after 1 + 2 + 4 RTO."""
    line = line_of(Chosen((1, 1), (1, 2), (1, 3)), Faults(delay=0.1, loss=0.5), Faults(delay=0.1))

    assert carried(line, [0.0]) == pytest.approx([7.0 * (0.2 + RTO_MIN) + 0.1])


@given(
    rate=st.floats(10.0, 1e5),
    packets=st.lists(st.tuples(st.integers(1, 1500), st.floats(0.0, 1.0)), min_size=1, max_size=30),
)
def test_a_bottleneck_serves_one_packet_after_the_other_at_its_rate(
    rate: float, packets: list[tuple[int, float]]
) -> None:
    """Each leaves size/rate after it came or after the one before left, whichever is later (Lindley's equation)."""
    slow, now, free, expected, left = Bottleneck(rate), 0.0, 0.0, [], []
    for size, gap in packets:
        now += gap
        left += slow.take(now)
        slow.put(Packet(1, bytes(size)), now)
        free = max(free, now) + size / rate
        expected.append(free)
    left += slow.take(1e9)

    assert [at for _, at in left] == pytest.approx(expected)
    assert slow.bytes == 0
    assert slow.until == NEVER


def test_a_change_of_the_rate_counts_for_the_rest_of_the_packet_that_leaves() -> None:
    """Half of a packet at 100 bytes/s and half at 50: half a second and one second."""
    slow = Bottleneck(100.0)
    slow.put(Packet(1, bytes(100)), 0.0)

    slow.set_rate(50.0, 0.5)

    assert slow.until == pytest.approx(1.5)
