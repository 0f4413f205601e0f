from __future__ import annotations

from scipy.stats import binom

from netem.relay import Faults, Relay
from tests.processes.relay.relay_pair import LOST, Pair, free_endpoint, measure

P = 0.02
"""Probability of loss."""

N, GAP = 1000, 0.004
"""Messages; time between two (s)."""

SURE = 1e-6
"""Chance that a sound link fails a bound of the binomial law."""

FEWEST, MOST = binom.ppf(SURE, N, P), binom.isf(SURE, N, P)
"""Messages that may be lost."""


def lost(times: list[float]) -> int:
    """How many messages never came."""
    return times.count(LOST)


def later_than(limit: float, times: list[float]) -> int:
    """How many messages took longer (s); the lost are not among them."""
    return sum(limit < time < LOST for time in times)


def test_two_percent_loss_is_delay_on_tcp_and_loss_on_udp() -> None:
    """Zenoh through two relays that lose 2 %: TCP brings all, the p99 later by a repetition; UDP loses some 2 %."""
    way = Faults(delay=0.01)
    R = 2.0 * way.delay
    tcp, udp = free_endpoint("tcp"), free_endpoint("udp")
    with (
        Relay("tcp/127.0.0.1:0", tcp, there=way, back=way, seed=7) as first,
        Relay("udp/127.0.0.1:0", udp, there=way, back=way, seed=7) as second,
        Pair(tcp, first.endpoint) as stream,
        Pair(udp, second.endpoint) as datagrams,
    ):
        for pair, relay in ((stream, first), (datagrams, second)):
            pair.greet()
            relay.do(f"loss {P}")
        on_tcp, on_udp = measure([stream, datagrams], N, GAP, lambda: [r.do("loss 0") for r in (first, second)])
        repeated = first.counts()[0].lost

    assert lost(on_tcp) == 0
    assert repeated >= FEWEST
    # at the earliest the very next message tells of a loss: it is repeated after 5/4 of a round trip
    assert sorted(on_tcp)[round(0.99 * N)] >= way.delay + 1.25 * R
    assert later_than(way.delay + 1.25 * R, on_tcp) >= repeated * 0.9
    assert FEWEST <= lost(on_udp) <= MOST


def test_zenoh_finds_back_over_tcp_through_a_relay_that_was_cut() -> None:
    """A cut ends the link at once, what is sent then is lost; healed, they are linked again without anybody's help."""
    target = free_endpoint("tcp")
    with Relay("tcp/127.0.0.1:0", target) as relay, Pair(target, relay.endpoint) as pair:
        pair.greet()
        relay.do("cut")
        pair.until(lambda: pair.sender.peers() == 0)
        pair.send()
        relay.do("heal")
        pair.greet()
        pair.send()
        pair.greet()
        in_the_cut, afterwards = pair.times()

    assert in_the_cut == LOST
    assert afterwards < LOST


def test_zenoh_goes_on_over_udp_after_a_cut_shorter_than_its_lease() -> None:
    """Nobody notices a short cut of UDP; what was sent in it is lost, what is sent afterwards comes."""
    target = free_endpoint("udp")
    with Relay("udp/127.0.0.1:0", target) as relay, Pair(target, relay.endpoint) as pair:
        pair.greet()
        relay.do("cut")
        there = relay.counts()[0]
        before = there.cut
        pair.send()
        pair.until(lambda: there.cut >= before + 2)  # the message, and a sign of life before or after it
        assert pair.sender.peers() == 1
        relay.do("heal")
        pair.send()
        pair.greet()
        in_the_cut, afterwards = pair.times()

    assert in_the_cut == LOST
    assert afterwards < LOST
