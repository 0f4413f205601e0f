"""The receiver: accounting, order, live changes, and fates that nothing elsewhere can change."""

from __future__ import annotations

import gc
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gridpeers.netem.fault_schedule import Heal
from gridpeers.netem.ledger import LinkTrace
from gridpeers.netem.models.delay import Lognormal, Uniform
from gridpeers.netem.models.loss import GilbertElliott
from gridpeers.netem.models.medium import Corrupt, Cut, Duplicate, Flap, Rate, Slots
from gridpeers.netem.receiver import Receiver
from gridpeers.netem.schema.fault import Fault, Span
from gridpeers.wire.links import Arrival
from tests.unit.netem.link_messages import T_C, receiver, steady

PAYLOAD = bytes(range(120))

KINDS: dict[str, Any] = {
    "delay": Lognormal(median_s=0.03, sigma=1.0),
    "loss": GilbertElliott(p=0.1, r=0.3),
    "duplicate": Duplicate(p=0.3, extra_delay_s=0.05),
    "corrupt": Corrupt(p=0.2, checksum=True),
    "rate": Rate(bytes_per_s=7000.0, queue_bytes=500),
    "slots": Slots(period_s=0.1, length_s=0.03),
    "cut": Cut(hold=True),
    "flap": Flap(up_s=0.2, down_s=0.1, hold=True),
}


def faults(on: str) -> st.SearchStrategy[Fault]:
    chosen = st.sets(st.sampled_from(list(KINDS)), min_size=1).map(lambda kinds: {kind: KINDS[kind] for kind in kinds})
    return st.builds(
        lambda kinds, start, length: Fault(on=on, from_s=start / 10, to_s=(start + length) / 10, **kinds),
        chosen,
        st.integers(0, 20),
        st.integers(1, 20),
    )


def send(to: Receiver, ticks: range, *sources: str) -> list[Arrival]:
    """Arrivals of one message per tick from each source, taken at every tick."""
    arrived = []
    for k in ticks:
        for src in sources or ("inv1",):
            to.offer(src, k, k * T_C, k * T_C, PAYLOAD)
        arrived += to.due(k * T_C)
    return arrived


def outcomes(traces: tuple[LinkTrace, ...]) -> dict[str, Any]:
    return {trace.src: dict(zip(trace.seq, trace.outcome, strict=True)) for trace in traces}


@steady
@given(
    st.lists(faults("* -> inv2"), max_size=4), st.lists(st.tuples(st.integers(1, 99), faults("* -> inv2")), max_size=3)
)
def test_the_account_of_every_link_balances(entries: list[Fault], live: list[tuple[int, Fault]]) -> None:
    """At every tick sent + duplicated = delivered + dropped + in flight, and delivered has all handed out."""
    to = receiver(*entries)
    handed = 0
    for k in range(100):
        for at, fault in live:
            if at == k:
                to.apply(replace(fault, from_s=max(k * T_C, fault.from_s)))
            if at + 10 == k:
                to.apply(Heal(on="* -> inv2", from_s=k * T_C))
        handed += len(send(to, range(k, k + 1), "inv1", "inv3"))
        assert all(count.closes for count in to.counts().values())
        assert handed == sum(count.delivered for count in to.counts().values())
        assert min(count.in_flight for count in to.counts().values()) >= 0
    to.due(1e6)
    assert all(count.closes and not count.in_flight for count in to.counts().values())


@steady
@given(faults("inv1 -> inv2"), faults("* -> inv3"), faults("inv4 -> inv2"), st.integers(1, 5))
def test_faults_elsewhere_change_no_fate_on_a_link(own: Fault, other: Fault, third: Fault, extra: int) -> None:
    """Faults and agents on other links leave every verdict of a link as it was."""
    alone, among = receiver(own), receiver(third, other, own)
    send(alone, range(100))
    send(among, range(100), *[f"inv{i}" for i in range(4, 4 + extra)], "inv1")

    assert alone.take_trace() == tuple(trace for trace in among.take_trace() if trace.src == "inv1")


@steady
@given(st.sets(st.sampled_from(["delay", "loss", "duplicate", "corrupt", "slots"]), min_size=1), st.integers(0, 90))
def test_a_cut_changes_no_fate_before_or_after_it(kinds: set[str], start: int) -> None:
    """Each message before and after a cut has the fate that it has without the cut."""
    own = {kind: KINDS[kind] for kind in kinds}
    whole, cut = (
        receiver(Fault(on="inv1 -> inv2", **own)),
        receiver(
            Fault(on="inv1 -> inv2", **own),
            Fault(on="inv1 -> inv2", cut=True, from_s=start * T_C, to_s=(start + 10) * T_C),
        ),
    )
    send(whole, range(100))
    send(cut, range(100))
    before, after = outcomes(whole.take_trace())["inv1"], outcomes(cut.take_trace())["inv1"]

    assert {k: after[k] for k in range(start, min(start + 10, 100))} == dict.fromkeys(
        range(start, min(start + 10, 100)), "cut"
    )
    assert {k: v for k, v in after.items() if v != "cut"} == {k: before[k] for k, v in after.items() if v != "cut"}


@steady
@given(st.sets(st.sampled_from(["delay", "loss", "duplicate", "corrupt"]), min_size=1), st.sets(st.integers(0, 99)))
def test_a_message_has_the_same_fate_in_simulated_and_real_time(kinds: set[str], missed: set[int]) -> None:
    """Jitter, the delay of real links, unseen messages and other processes change no fate."""
    fault = Fault(on="inv1 -> inv2", **{kind: KINDS[kind] for kind in kinds})
    simulated, realtime = receiver(fault), receiver(fault)
    send(simulated, range(100))
    for k in sorted(set(range(100)) - missed):
        realtime.offer("inv1", k, 0.7 + k * 0.0213, 0.703 + k * 0.0213, PAYLOAD)
    fates, seen = outcomes(simulated.take_trace()), outcomes(realtime.take_trace())

    assert seen.get("inv1", {}) == {k: v for k, v in fates["inv1"].items() if k not in missed}


@steady
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 8)), max_size=30))
def test_messages_are_handed_out_in_the_order_of_arrival_number_and_sender(offers: list[tuple[int, int]]) -> None:
    """Messages of one arrival time are sorted by number, then by sender, in whatever order they are offered."""
    to = receiver(Fault(on="* -> inv2", delay=0.3))
    for src, seq in dict.fromkeys(offers):
        to.offer(f"inv{3 + src}", seq, seq * 0.1, seq * 0.1, bytes([seq, src]))

    arrived = [tuple(arrival.payload) for arrival in to.due(10.0)]

    assert arrived == sorted({(seq, src) for src, seq in offers})


def test_a_delay_of_whole_ticks_ends_at_that_tick() -> None:
    """A message of tick k with a delay of 5 T_c arrives at tick k + 5 and not before, for each of 10 000 ticks."""
    to = receiver(Fault(on="* -> inv2", delay=0.1))
    for k in range(10_000):
        to.offer("inv1", k, k * T_C, k * T_C, PAYLOAD)
        assert len(to.due(k * T_C)) == (k >= 5)


@steady
@given(st.lists(st.floats(0.0, 0.015), min_size=20, max_size=20))
def test_real_jitter_reorders_no_messages_that_netem_keeps_in_order(jitter: list[float]) -> None:
    """In real time the jitter of the real link adds to netem's delays, and no message overtakes another through it."""
    to = receiver(Fault(on="inv1 -> inv2", delay=Uniform(low_s=0.01, high_s=0.2, fifo=True)))
    at = 0.0
    for k in range(20):
        at = max(at, k * T_C + jitter[k])
        to.offer("inv1", k, k * T_C, at, bytes([k]))

    arrived = [arrival.payload[0] for step in range(200) for arrival in to.due(step * 0.002)] + [
        arrival.payload[0] for arrival in to.due(9.0)
    ]
    assert arrived == list(range(20))


def test_a_corrupted_message_has_one_flipped_bit_or_is_dropped_by_the_checksum() -> None:
    """Without a checksum the flipped message is handed on; with it the same messages are dropped and counted."""
    plain, checked = (receiver(Fault(on="* -> inv2", corrupt=Corrupt(p=0.3, checksum=c))) for c in (False, True))
    handed, sound = send(plain, range(200)), send(checked, range(200))
    changed = [
        sum((one ^ other).bit_count() for one, other in zip(arrival.payload, PAYLOAD, strict=True))
        for arrival in handed
    ]

    assert set(changed) == {0, 1}
    assert sum(changed) == plain.counts()["inv1"].corrupted == checked.counts()["inv1"].dropped["checksum"]
    assert [arrival.payload for arrival in sound] == [PAYLOAD] * changed.count(0)


def test_a_link_without_a_fault_is_known_and_not_recorded() -> None:
    """A link knows before any message whether a fault can act; untouched messages are counted and not recorded."""
    to = receiver(Fault(on="inv1 -> inv2", delay=0.1, from_s=50.0), Fault(on="plant -> inv3", loss=0.1))

    assert [to.touched(src) for src in ("inv1", "inv3", "plant")] == [True, False, False]
    assert len(send(to, range(10), "inv3")) == 10
    assert to.take_trace() == ()
    assert to.counts()["inv3"].delivered == 10


def test_a_live_fault_acts_from_its_time_on_and_heals() -> None:
    """Messages sent before the change or after the healing follow the scenario, those between follow the change."""
    to = receiver(Fault(on="* -> inv2", delay=0.1))
    send(to, range(50))
    assert to.apply(Fault(on="inv1 <-> inv2", from_s=1.0, delay=0.5, loss=0.0)) == ("inv1",)
    send(to, range(50, 100))
    to.apply(Heal(on="inv1 <-> inv2", from_s=2.0, kinds=("loss",)))
    send(to, range(100, 150))
    to.apply(Heal(on="* -> inv2", from_s=3.0))
    send(to, range(150, 200))
    seen = outcomes(to.take_trace())["inv1"]

    assert [seen[k] for k in range(200)] == [0.1] * 50 + [0.5] * 100 + [0.0] * 50


def test_healing_a_holding_cut_releases_messages_like_a_planned_end() -> None:
    """A live cut, healed at 1 s, delivers the same messages at the same times as a cut planned until 1 s."""
    rest = Fault(on="* -> inv2", delay=0.05, rate=Rate(bytes_per_s=20_000.0), loss=0.2, duplicate=0.2)
    live, planned = receiver(rest), receiver(rest, Fault(on="inv1 -> inv2", cut=Cut(hold=True), from_s=0.5, to_s=1.0))
    arrived = send(live, range(25))
    live.apply(Fault(on="inv1 -> inv2", from_s=0.5, cut=Cut(hold=True)))
    arrived += send(live, range(25, 50))
    assert live.counts()["inv1"].in_flight >= 25
    live.apply(Heal(on="inv1 -> inv2", from_s=1.0, kinds=("cut",)))
    arrived += send(live, range(50, 100))

    assert arrived == send(planned, range(100))
    live.due(9.0)
    planned.due(9.0)
    assert live.counts() == planned.counts()
    assert outcomes(live.take_trace()) == outcomes(planned.take_trace())


def test_faults_of_long_ago_are_forgotten_and_change_no_fate() -> None:
    """A run of hours has hundreds of commands; a link with a past fault still differs from one without."""
    lossy = Fault(on="inv1 -> inv2", loss=0.3, delay=0.05, from_s=0.0, to_s=1.0)
    ahead = [replace(lossy, from_s=10.0 * k, to_s=10.0 * k + 1.0) for k in range(60)]
    live, planned, known = receiver(), receiver(*ahead), dict[int, int]()
    fates: list[list[Arrival]] = [[], []]
    for k in range(600):
        if k % 10 == 0:
            live.apply(ahead[k // 10])
            if k in (160, 590):
                known[k] = sum(type(it) is Span for it in gc.get_objects())
        for to, found in zip((live, planned), fates, strict=True):
            to.offer("inv1", k, float(k), float(k), PAYLOAD)
            found += to.due(k + 0.5)
    assert fates[0] == fates[1]
    assert live.trace_sha256 == planned.trace_sha256
    assert known[590] <= known[160]
    assert live.was_impaired("inv1", 0.5)
    assert not receiver().was_impaired("inv1", 0.5)
