"""The bytes of every message are pinned: agents written by others, and records of before, hold to them."""

from __future__ import annotations

import pytest

from gridpeers.wire.codec import decode, encode
from gridpeers.wire.messages import MESSAGES, Message
from tests.golden.messages.message_values import with_defaults
from tests.golden.messages.pin import FILE, LEAST, WHOLE, messages

PINNED = {
    name: bytes.fromhex(text.replace("\n", ""))
    for name, _, text in (block.partition("\n") for block in FILE.read_text(encoding="ascii").split("\n\n"))
}
"""Bytes by type of message, and whether every field or the fewest are given."""
VALUES = messages()


@pytest.mark.parametrize("name", VALUES)
def test_a_message_has_the_pinned_bytes(name: str) -> None:
    """The same values give the same bytes as ever."""
    assert encode(VALUES[name]).hex() == PINNED[name].hex()


@pytest.mark.parametrize("name", PINNED)
def test_pinned_bytes_give_the_message(name: str) -> None:
    """What older programs send is understood; repr, because NaN differs from itself."""
    assert repr(decode(PINNED[name])) == repr(VALUES[name])


def test_every_type_and_every_field_is_pinned() -> None:
    """A new type or field is pinned with its first commit: the whole messages leave nothing at its default.

    `python -m tests.golden.messages.pin` pins it.
    """
    assert tuple(map(type, WHOLE)) == MESSAGES
    assert [(type(message).__name__, with_defaults(message)) for message in WHOLE if with_defaults(message)] == []
    assert set(map(type, LEAST)) == {kind for kind in MESSAGES if _has_defaults(kind)}
    assert PINNED.keys() == VALUES.keys()


def _has_defaults(kind: type[Message]) -> bool:
    return len(kind.__struct_defaults__) > 0
