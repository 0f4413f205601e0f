from __future__ import annotations

import math
from typing import Any, get_args
from zlib import crc32

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wire.codec import CRC, KINDS, LIMIT, RejectedError, Rejects, decode, encode
from wire.messages import MESSAGES, Angle, AnyMessage, PlantEvent, State, Telemetry, Waiting

STATE = State(sender="inv1", incarnation=1, seq=3, t=0.06, P_set=3e5, V_set=277.0, Q=-1e4)


def sealed(body: bytes) -> bytes:
    """Bytes with a checksum that is right."""
    return body + crc32(body).to_bytes(CRC, "little")


def kind_of(payload: bytes) -> str:
    """Kind of reject that the bytes are."""
    with pytest.raises(RejectedError) as rejected:
        decode(payload)
    return rejected.value.kind


@pytest.mark.parametrize("kind", MESSAGES)
def test_every_message_survives_the_wire(kind: type[msgspec.Struct]) -> None:
    """What is encoded comes back equal, for each type of message."""

    def fill(field: msgspec.structs.FieldInfo) -> Any:
        examples = {"kind": "GFM", "roster": ("inv1", "inv2"), "instances": ("a", "b"), "inverters": ("inv1",)}
        events = (PlantEvent(t=1.0, kind="switch", subject="13-152", text="opened"),)
        more = {"rows": ((0.0, 60.0),), "events": events, "incarnation": 2, "seq": 7}
        flags = {"grid_connected": True, "final": False, "reproducible": True}
        words = {"sender": "inv1", "to": "inv1", "island": "grid", "microgrid": "mg1", "reason": "end", "outcome": ""}
        flags |= {"refused": True, "ok": False}
        words |= {"verb": "open", "argument": "sw1_2", "reply_to": "a1", "text": "done", "phase": "running"}
        words |= {
            "waits_for": ("inv2",) if kind is Waiting else "",
            "pacing": None,
            "data": b"book",
            "instance": "a1",
            "angle": Angle(0.3, 1.5),
        }
        lists = {
            "impaired": ("inv2",),
            "neighbours": ("inv2", "inv3"),
            "ages": (0.01, -1.0),
            "used": ("inv2",),
            "awaited": ("inv2",),
        }
        counts = dict.fromkeys(("received", "sent", "rejected", "lost", "ticks", "missed"), 9)
        return (examples | more | flags | words | lists | counts).get(field.name, 0.1 + 0.2)

    message = kind(**{field.name: fill(field) for field in msgspec.structs.fields(kind)})

    assert decode(encode(message)) == message  # type: ignore[arg-type]


def test_the_list_of_messages_is_whole() -> None:
    """Documentation made from `MESSAGES` leaves none out."""
    assert set(MESSAGES) == set(get_args(AnyMessage))


def test_the_same_message_gives_the_same_bytes() -> None:
    """Bytes depend on the message alone, so that runs can be compared by them."""
    assert encode(STATE) == encode(msgspec.structs.replace(STATE))


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_numbers_must_be_finite(number: float) -> None:
    """A NaN would spread to every neighbour; it is stopped at the door."""
    assert kind_of(encode(msgspec.structs.replace(STATE, P_set=number))) == "not finite"


def test_rejects_are_told_apart() -> None:
    """Oversized, corrupt, unknown and garbled bytes are four kinds."""
    whole = msgspec.to_builtins(STATE)

    def kind_of_changed(**changes: Any) -> str:
        return kind_of(sealed(msgspec.msgpack.encode(whole | changes)))

    assert kind_of(b"\xc1" * (LIMIT + 1)) == "oversized"
    assert kind_of(b"") == kind_of(encode(STATE)[:-1]) == kind_of(encode(STATE)[:-4]) == "corrupt"
    assert kind_of(sealed(b"")) == "garbled"
    assert kind_of_changed(type="Bomb") == "unknown"
    assert kind_of_changed(P_set="high") == "garbled"
    assert kind_of_changed(extra=1) == "garbled"
    assert kind_of_changed(seq=-1) == "garbled"
    assert kind_of_changed(sender="x" * 65) == "garbled"
    assert kind_of(sealed(b"\x91" * 5000)) == "garbled"


@given(st.binary(max_size=300), st.booleans())
def test_no_bytes_raise_anything_but_a_reject(payload: bytes, right: bool) -> None:
    """No message may stop an agent, whether or not its checksum is right."""
    with pytest.raises(RejectedError) as rejected:
        decode(sealed(payload) if right else payload)

    assert rejected.value.kind in KINDS


@given(st.data())
def test_a_damaged_message_is_rejected_or_whole(data: st.DataObject) -> None:
    """After damage that the checksum does not show a message is refused, or has finite numbers."""
    payload = bytearray(encode(STATE)[:-4])
    payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    try:
        message = decode(sealed(bytes(payload)))
    except RejectedError:
        return

    assert all(math.isfinite(x) for x in msgspec.structs.astuple(message) if isinstance(x, float))


def test_every_flipped_bit_is_caught() -> None:
    """Whichever bit of a message or of its checksum is flipped, in a number too, the message is refused as corrupt."""
    payload = encode(STATE)
    flipped = [bytearray(payload) for _ in range(8 * len(payload))]
    for bit, damaged in enumerate(flipped):
        damaged[bit // 8] ^= 1 << bit % 8

    assert {kind_of(bytes(damaged)) for damaged in flipped} == {"corrupt"}


def test_one_line_is_kept_for_each_kind() -> None:
    """A flood of garbage fills counters, not logs."""
    rejects = Rejects("inv1")
    for _ in range(1000):
        rejects.add("garbled", "some/key", "y" * 10_000)
    rejects.add("ghost", "some/key", "old")

    lines = rejects.take_lines()

    assert rejects.counts == {"garbled": 1000, "ghost": 1}
    assert len(lines) == 2
    assert max(map(len, lines)) < 500
    assert rejects.take_lines() == ()


def test_telemetry_may_carry_what_is_not_finite() -> None:
    """The recorder is told the plant's truth, even where it is not a number."""
    telemetry = Telemetry(
        sender="plant", incarnation=1, seq=0, t=0.0, inverters=("inv1",), rows=((0.0, math.nan),), events=(),
        final=False, outcome="", reproducible=True,
    )  # fmt: skip

    decoded = decode(encode(telemetry))

    assert isinstance(decoded, Telemetry)
    assert math.isnan(decoded.rows[0][1])
