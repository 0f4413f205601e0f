"""What depends on time: cuts, flaps, slots, the queue of a slow line, and the order of it all."""

from __future__ import annotations

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gridpeers.netem.channel import Channel
from gridpeers.netem.models.delay import Constant
from gridpeers.netem.models.medium import Cut, Duplicate, Flap, Rate, Slots
from gridpeers.netem.schema.fault import Span
from gridpeers.netem.schema.pattern import Link
from tests.unit.netem.link_messages import T_C, channel, fates, steady

time = st.integers(0, 200).map(lambda k: k / 10)


def spans(*entries: tuple[str, float, float, object]) -> Channel:
    return Channel(Link("inv1", "inv2"), [Span(*entry) for entry in entries], seed=1)


@steady
@given(st.integers(0, 500), st.integers(0, 500))
def test_a_cut_drops_messages_sent_from_its_start_until_before_its_end(start: int, end: int) -> None:
    """Messages of ticks start <= k < end are dropped, whatever the rounding of k T_c."""
    assume(start < end)
    judge = channel(cut=True, from_s=round(start * 0.02, 9), to_s=round(end * 0.02, 9))

    dropped = [seq for seq, fate in enumerate(fates(judge, range(501))) if fate.reason == "cut"]

    assert dropped == list(range(start, min(end, 501)))


def test_a_holding_cut_releases_all_messages_at_its_end() -> None:
    """With hold, messages of the cut arrive together when it ends; none is lost."""
    kept = fates(spans(("cut", 0.1, 0.5, Cut(hold=True)), ("delay", 0.0, 9.0, Constant(delay_s=0.01))), range(40))

    assert [seq * T_C + fate.deliveries[0][0] for seq, fate in enumerate(kept)] == pytest.approx(
        [(0.5 if 5 <= seq < 25 else seq * T_C) + 0.01 for seq in range(40)]
    )
    assert {fate.held_until for fate in kept[5:25]} == {0.5}


def test_messages_released_by_one_cut_meet_the_next_cut() -> None:
    """A released message is lost by a cut that loses, and held again by a cut that holds."""
    lost = spans(("cut", 0.0, 1.0, Cut(hold=True)), ("partition", 1.0, 2.0, Cut()))
    kept = spans(("cut", 0.0, 1.0, Cut(hold=True)), ("flap", 0.0, 9.0, Flap(up_s=0.5, down_s=1.0, hold=True)))

    assert lost.judge(0, 0.5, 10).reason == "partition"
    assert kept.judge(0, 0.2, 10).deliveries == ((pytest.approx(1.3), None),)


@steady
@given(st.integers(1, 20), st.integers(1, 20), st.integers(0, 300))
def test_a_flap_alternates_between_up_and_down(up: int, down: int, start: int) -> None:
    """From its start on, a flapping link is up for up_s and down for down_s, tick by tick."""
    flap = Flap(up_s=round(up * T_C, 9), down_s=round(down * T_C, 9))
    judged = fates(channel(flap=flap, from_s=round(start * T_C, 9)), range(400))

    for seq, fate in enumerate(judged):
        assert (fate.reason == "flap") == (seq >= start and (seq - start) % (up + down) >= up)


@steady
@given(st.integers(1, 40), st.integers(0, 40), st.integers(1, 40), st.integers(0, 2000))
def test_a_message_leaves_in_the_first_open_slot(period: int, offset: int, length: int, tick: int) -> None:
    """It leaves at once in an open slot, else at the start of the next; a count in whole milliseconds agrees."""
    assume(offset < period and length <= period)
    slots = Slots(period_s=period / 1000, offset_s=offset / 1000, length_s=length / 1000)

    goes = next(ms for ms in range(tick, tick + 2 * period) if (ms - offset) % period < length)

    assert slots.opens(tick / 1000) == pytest.approx(goes / 1000, abs=1e-9)


@steady
@given(
    st.lists(st.tuples(st.integers(0, 300), st.integers(1, 400)), max_size=40), st.integers(1, 20), st.integers(1, 900)
)
def test_a_slow_line_sends_byte_after_byte(gaps: list[tuple[int, int]], rate: int, queue: int) -> None:
    """A simulation byte by byte gives the same times and drops, with waiting and with a full queue."""
    judge = channel(rate=Rate(bytes_per_s=1000.0 * rate, queue_bytes=queue))
    now, free = 0, 0.0  # ms; bytes per ms is the rate
    for seq, (gap, size) in enumerate(gaps):
        now += gap
        waiting = max(free - now, 0.0) * rate
        fate = judge.judge(seq, now / 1000, size)
        assume(abs(waiting + size - queue) > 1e-3)
        if waiting > 1e-9 and waiting + size > queue:
            assert fate.reason == "queue"
        else:
            free = max(now, free) + size / rate
            assert fate.deliveries[0][0] == pytest.approx((free - now) / 1000, abs=1e-9)


def test_all_faults_together_act_in_the_documented_order() -> None:
    """Held by a cut until 1.0 s, 0.1 s on the line, slot at 1.25 s, 0.5 s of delay, and a copy 0.125 s later."""
    judge = spans(
        ("cut", 0.0, 1.0, Cut(hold=True)),
        ("rate", 0.0, 9.0, Rate(bytes_per_s=1000.0)),
        ("slots", 0.0, 9.0, Slots(period_s=0.25, length_s=0.0625)),
        ("delay", 0.0, 9.0, Constant(delay_s=0.5)),
        ("duplicate", 0.0, 9.0, Duplicate(p=1.0, extra_delay_s=0.125)),
    )

    assert judge.judge(0, 0.5, 100).deliveries == ((1.25, None), (1.375, None))
