"""Entries of a journal, whole or damaged."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gridpeers.scenarios.record.journal_reader import entries_of, values_of
from gridpeers.wire.journal import Entry, Exchange, MessageReference, RejectedCount, SentMessage, Token
from gridpeers.wire.messages import LONGEST_MESSAGE
from tests.hostile.cases import sealed

ENTRIES: list[Entry] = [
    Exchange(3, [b"measured", [1, 2.5, None]], [b"state", ["inv1", True]]),
    SentMessage(1.25, "control", bytes(range(256))),
    MessageReference(0.5, "state/inv1", 1, 7),
    MessageReference(None, "state/inv1", 1, 7, "late"),
    RejectedCount(2.0, "state/inv2", "garbled", 12),
    Token(None, "alive/agent/inv1/a", True),
]
PARTS = [msgspec.msgpack.encode(entry) for entry in ENTRIES]


LATER = msgspec.msgpack.encode(["later", 1])
LIST_AS_KEY = b"\x81\x91\x01\x01"  # A map that Python cannot have


def read(data: bytes) -> tuple[list[Entry], list[str]]:
    """Return the entries that can be read, and what is said of the others."""
    damage: list[ValueError] = []
    found = list(entries_of(data, damage.append))
    return found, [str(error) for error in damage]


def test_a_sound_part_has_all_its_entries_beside_those_of_a_later_version_too() -> None:
    """They come in their order; an entry of a kind that is not known yet is left out without a word."""
    assert read(b"".join(PARTS)) == (ENTRIES, [])
    assert read(b"".join([*PARTS[:2], LATER, *PARTS[2:]])) == (ENTRIES, [])
    assert read(b"") == ([], [])


@given(st.lists(st.sampled_from(PARTS), max_size=5), st.binary(max_size=6), st.integers(0, 60))
@example([PARTS[2]], b"\xc1", 60)
def test_bytes_that_are_none_of_ours_raise_no_other_error(parts: list[bytes], wrong: bytes, at: int) -> None:
    """What comes before them is read all the same."""
    whole = b"".join(parts)
    found, _ = read(whole[:at] + wrong + whole[at:])

    before = read(whole[:at])[0]
    assert found[: max(0, len(before) - 1)] == before[: max(0, len(before) - 1)]


@pytest.mark.parametrize("added", [b"\x07", b"\xd4\x05\x00"], ids=["number", "extension"])
def test_a_value_that_a_later_version_added_is_left_out(added: bytes) -> None:
    """The entry counts without it."""
    assert read(bytes([PARTS[1][0] + 1]) + PARTS[1][1:] + added) == ([ENTRIES[1]], [])


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (PARTS[1] + PARTS[3][:-1], "within the entry"),
        (PARTS[1] + msgspec.msgpack.encode(["token", "no time"]), "an entry is none of ours"),
        (PARTS[1] + LIST_AS_KEY, "an entry is none of ours"),
        (bytes(LONGEST_MESSAGE + 1), "a part of a journal has at most"),
    ],
    ids=["cut off", "another form", "no map of Python", "too long"],
)
def test_damage_is_told_and_raised_where_nobody_takes_it(data: bytes, said: str) -> None:
    """The entries before it are there."""
    found, damage = read(data)

    assert found == ([] if len(data) > LONGEST_MESSAGE else [ENTRIES[1]])
    assert len(damage) == 1
    assert said in damage[0]
    with pytest.raises(ValueError, match=said):
        list(entries_of(data))
    assert values_of(sealed(LIST_AS_KEY)) == {}
