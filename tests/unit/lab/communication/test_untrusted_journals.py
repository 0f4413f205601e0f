"""The pass of the checks over a record does not trust its journals: what cannot be true is left out, and counted."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from gridpeers.netem.ledger import LinkTrace
from gridpeers.wire.codec import encode
from gridpeers.wire.messages import MOST_COUNT, State
from tests.fuzz.journals import judged, link_report

DECISION = ["decision", 4, 1, ["inv2"], [1], [], []]


def packed(*entries: Any) -> bytes:
    return b"".join(map(msgspec.msgpack.encode, entries))


def sent(number: int, t: float) -> list[Any]:
    state = State(sender="inv1", epoch=1, seq=MOST_COUNT, t=0.5, P_set=0.0, V_set=1.0, Q=0.0)
    values = msgspec.msgpack.decode(encode(state)[:-4]) | {"seq": number, "t": t}
    return ["sent", None, "state/inv1", msgspec.msgpack.encode(values) + bytes(4)]


GOOD = packed(sent(4, 0.08))

BAD = {
    "a list as key": b"\x81\x91\x01\x01",
    "no kind": packed([]),
    "a short entry": packed(["heard", 1.0, "state/inv1"]),
    "a decision of texts": packed(["decision", "x", "y", "z", [], [], []]),
    "an exchange of short states": packed(["exchange", 1, [], [[1]]]),
    "a number above 2^63": packed(sent(2**63, 0.1)),
    "a time to come": packed(sent(5, 1e9)),
    "no time": packed(sent(5, float("nan"))),
    "cut off": packed(DECISION)[:-2],
}


@pytest.mark.parametrize("clock", ["simulated", "realtime"])
@pytest.mark.parametrize("bad", BAD)
def test_what_is_none_of_ours_is_counted_and_the_rest_is_read(bad: str, clock: str) -> None:
    """One bad entry of one agent, between sound ones of it and of another: both have their states."""
    other = packed(["sent", None, "state/inv2", sent(4, 0.08)[3].replace(b"inv1", b"inv2")])
    sums, _ = judged([("inv1", GOOD + BAD[bad]), ("inv2", other)], clock=clock)
    found = sums.finish()

    assert found.unreadable == 1
    assert {name: of.spoke_at for name, of in found.sent.items()} == {"inv1": 0.08, "inv2": 0.08}


def test_a_decision_to_come_keeps_no_other_one_out() -> None:
    """In simulated time decisions are taken in order: one of a tick far ahead would be the last one."""
    to_come = packed([*DECISION[:1], 2**60, *DECISION[2:]])
    sums, unreadable = judged([("inv1", to_come + packed(DECISION) + GOOD)], clock="simulated")

    assert (unreadable, bool(sums.finish().oldest)) == (1, True)


@pytest.mark.parametrize(("number", "t"), [(MOST_COUNT, 0.02), (2, 1e9)])
def test_a_verdict_on_a_message_to_come_is_counted_and_left_out(number: int, t: float) -> None:
    """A run of 1 s has 50 ticks."""
    trace = LinkTrace("inv1", "inv2", (1, number), (0.02, t), ("cut", 0.0))
    _, unreadable = judged([], [link_report("inv2", trace)], clock="simulated")

    assert unreadable == 1


def test_a_new_session_in_a_journal_begins_new_accounts_of_links() -> None:
    """inv2 opens one after 0.5 s and hears inv1 again from 0.7 s on: that the states between are lost is no fault."""
    new = ["process", 1.0, "session", "instance b"]
    states = [sent(k, 0.1 * k) for k in range(10)]
    heard = [["heard", 1.0, "state/inv1", 1, k, ""] for k in range(10) if k not in (5, 6)]
    other = [[*entry[:2], "state/inv2", entry[3].replace(b"inv1", b"inv2")] for entry in states]
    found = {
        renewed: judged([("inv1", packed(*states)), ("inv2", packed(*heard, *entries))], clock="realtime")
        for renewed, entries in ((True, [*other[:6], new, *other[6:]]), (False, other))
    }

    (whole,) = found[False][0].finish().arrivals["inv1", "inv2"]
    assert sorted(number for _, number in whole.missing) == [5, 6]
    before, after = found[True][0].finish().arrivals["inv1", "inv2"]
    assert (before.until, [number for _, number in before.missing], after.missing) == (pytest.approx(0.5), [5], {})
