"""The pass of the checks over a record does not trust its journals: what cannot be true is left out, and counted."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from tests.fuzz.journals import judged
from wire.bounds import MOST_COUNT
from wire.codec import encode
from wire.messages import State

DECISION = ["decision", 4, 1, ["inv2"], [1], [], []]


def packed(*entries: Any) -> bytes:
    """Entries of a journal."""
    return b"".join(map(msgspec.msgpack.encode, entries))


def sent(number: int, t: float) -> list[Any]:
    """An entry with a state of inv1."""
    state = State(sender="inv1", epoch=1, seq=MOST_COUNT, t=0.5, P_set=0.0, V_set=1.0, Q=0.0)
    values = msgspec.msgpack.decode(encode(state)[:-4]) | {"seq": number, "t": t}
    return ["sent", None, "state/inv1", msgspec.msgpack.encode(values) + bytes(4)]


GOOD = packed(sent(4, 0.08))

BAD = {
    "a list as key": b"\x81\x91\x01\x01",
    "a number": packed(5),
    "no kind": packed([]),
    "a kind that is none": packed([None, 1]),
    "a short entry": packed(["heard", 1.0, "state/inv1"]),
    "a short received": packed(["received", 1.0, "state/inv1"]),
    "a decision of texts": packed(["decision", "x", "y", "z", [], [], []]),
    "an exchange of numbers": packed(["exchange", 1, [], [7]]),
    "an exchange of short states": packed(["exchange", 1, [], [[1]]]),
    "a number above 2^63": packed(sent(2**63, 0.1)),
    "a negative number": packed(sent(-1, 0.1)),
    "a time to come": packed(sent(5, 1e9)),
    "no time": packed(sent(5, float("nan"))),
    "cut off": packed(DECISION)[:-2],
}


@pytest.mark.parametrize("clock", ["simulated", "wall"])
@pytest.mark.parametrize("bad", BAD)
def test_what_is_none_of_ours_is_counted_and_the_rest_is_read(bad: str, clock: str) -> None:
    """One bad entry of one agent, between sound ones of it and of another: both have their states."""
    other = packed(["sent", None, "state/inv2", sent(4, 0.08)[3].replace(b"inv1", b"inv2")])
    sums, unreadable = judged([("inv1", GOOD + BAD[bad]), ("inv2", other)], clock=clock)
    found = sums.finish(unreadable)

    assert found.unreadable == 1
    assert {name: of.spoke_at for name, of in found.sent.items()} == {"inv1": 0.08, "inv2": 0.08}


def test_a_decision_to_come_keeps_no_other_one_out() -> None:
    """In simulated time decisions are taken in order: one of a tick far ahead would be the last one."""
    to_come = packed([*DECISION[:1], 2**60, *DECISION[2:]])
    sums, unreadable = judged([("inv1", to_come + packed(DECISION) + GOOD)], clock="simulated")

    assert (unreadable, sums.finish(unreadable).used) == (1, True)


def test_a_bad_entry_does_not_end_a_part() -> None:
    """What follows it is read, as of a kind that a later version has, which is not counted."""
    sums, unreadable = judged([("inv1", packed(["later", 1], ["heard"]) + GOOD)], clock="wall")

    assert (unreadable, sums.finish(unreadable).sent["inv1"].spoke_at) == (1, 0.08)
