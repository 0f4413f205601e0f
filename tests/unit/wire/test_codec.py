from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import msgspec
import pytest
from msgspec import inspect

from gridpeers.wire.codec import RejectedError, RejectedMessages, decode, encode
from gridpeers.wire.messages import (
    LONGEST_MESSAGE,
    MESSAGES,
    AgentStatus,
    LinkReport,
    Measurement,
    Message,
    Prepare,
    State,
    Telemetry,
)
from tests.hostile.cases import cases, packed, plain, sealed, sound

STATE = State(sender="inv1", epoch=1, seq=3, t=0.06, P_set=3e5, V_set=277.0, Q=-1e4)


def refusal(payload: bytes) -> str:
    try:
        decode(payload)
    except RejectedError as rejected:
        return rejected.kind
    return ""


@pytest.mark.parametrize("kind", MESSAGES)
def test_every_field_has_bounds_and_only_what_is_within_is_believed(kind: type[Message]) -> None:
    """A value at its bounds is accepted. The message is refused if a value is outside, missing or of another type."""
    tried = 0
    for case in cases(kind):
        refused = refusal(case.payload)
        assert refused in ("", "implausible", "garbled", "oversized")
        assert case.within in (None, not refused), f"{kind.__name__}.{case.path} = {case.value!r:.80}: {refused}"
        tried += 1

    assert tried > 50


def test_no_field_is_without_bounds() -> None:
    """Numbers, texts, bytes and lists are bounded. Only the rows for the recorder may hold any number."""

    def unbounded(type_: Any, path: str) -> list[str]:
        type_ = plain(type_)
        match type_:
            case inspect.FloatType() | inspect.IntType():
                return [] if type_.le is not None and (type_.ge is not None or type_.gt is not None) else [path]
            case inspect.StrType():
                return [] if type_.pattern is not None else [path]
            case inspect.BytesType():
                return [] if type_.max_length is not None else [path]
            case inspect.VarTupleType():
                own = [] if type_.max_length is not None else [path]
                return own + unbounded(type_.item_type, f"{path}[]")
            case inspect.UnionType():
                return [name for part in type_.types for name in unbounded(part, path)]
            case inspect.StructType():
                return [name for field in type_.fields for name in unbounded(field.type, f"{path}.{field.name}")]
        return []

    found = [name for kind in MESSAGES for name in unbounded(inspect.type_info(kind), kind.__name__)]

    assert found == ["Telemetry.rows[]", "Telemetry.rows[][]"]


@pytest.mark.parametrize(("kind", "changes"), [
    (Measurement, {"roster": ["inv1", "inv2", "inv1"]}),
    (Prepare, {"instances": ["a"]}),
    (Prepare, {"roster": ["inv1", "inv1"]}),
    (LinkReport, {"final": True, "instance": ""}),
    (AgentStatus, {"ages": [0.1]}),
    (AgentStatus, {"neighbours": ["inv2", "inv2"], "ages": [0.1, 0.2]}),
    (Telemetry, {"inverters": ["inv1", "inv2"]}),
    (Telemetry, {"rows": [[0.0, *[1.0] * 6], [0.0, *[1.0] * 6]]}),
    (Telemetry, {"rows": [[math.nan, *[1.0] * 6]]}),
    (Telemetry, {"rows": [[]]}),
])  # fmt: skip
def test_what_a_message_says_twice_must_agree(kind: type[Message], changes: dict[str, Any]) -> None:
    """Rosters have no name twice, related lists have one length, and rows are in order of time."""
    assert refusal(packed(sound(kind, **changes))) == "implausible"


def test_rejects_are_told_apart() -> None:
    """Oversized, corrupt, unknown and garbled bytes are four kinds."""
    whole = msgspec.to_builtins(STATE)

    def refusal_of(**changes: Any) -> str:
        return refusal(sealed(msgspec.msgpack.encode(whole | changes)))

    assert refusal(b"\xc1" * (LONGEST_MESSAGE + 1)) == "oversized"
    assert refusal(b"") == refusal(encode(STATE)[:-1]) == refusal(encode(STATE)[:-4]) == "corrupt"
    assert refusal(sealed(b"")) == "garbled"
    assert refusal_of(type="Bomb") == "unknown"
    assert refusal_of(P_set="high") == "garbled"
    assert refusal_of(extra=1) == "garbled"
    assert refusal_of(seq=-1) == refusal_of(seq=2**63) == refusal_of(seq=2**64 - 1) == "implausible"
    assert refusal_of(sender="x" * 65) == refusal_of(sender="\x1b[2J") == "implausible"
    assert refusal_of(P_set=1e300) == "implausible"
    assert refusal(sealed(b"\x91" * 5000)) == "garbled"


def test_every_flipped_bit_is_caught() -> None:
    """Whichever bit of a message or of its checksum is flipped, in a number too, the message is refused as corrupt."""
    payload = encode(STATE)
    flipped = [bytearray(payload) for _ in range(8 * len(payload))]
    for bit, damaged in enumerate(flipped):
        damaged[bit // 8] ^= 1 << bit % 8

    assert {refusal(bytes(damaged)) for damaged in flipped} == {"corrupt"}


def test_lines_are_printable_whatever_was_sent() -> None:
    """People read logs on terminals: no received bytes may clear the screen or forge a line."""
    rejects = RejectedMessages("inv1")
    rejects.add("unknown", "some/key", "type \x1b[2J\n2026-01-01 ERROR \u202egnorw si lla")
    rejects.add("failed", "some/key", "KeyError: '\x1b'", "Traceback\n" + "  at \x1b[31m\n" * 1000)

    one, traced = rejects.take_lines()

    assert one.isprintable()
    assert all(line.isprintable() for line in traced.split("\n"))
    assert 30 < len(traced.split("\n")) < 50


def test_a_process_that_decodes_ends_well() -> None:
    """Msgspec 0.22 corrupts memory for some unions of bounded types. The process crashes only at its end."""
    done = subprocess.run(
        [sys.executable, "-c", "import gridpeers.wire.codec, gridpeers.scenarios.emulation.link_data"], check=False
    )

    assert done.returncode == 0
