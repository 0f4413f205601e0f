"""Entries of a journal, read at once or one by one."""

from __future__ import annotations

from contextlib import suppress

import msgspec
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gridpeers.scenarios.record.journal_reader import entries_of, entry_of, raw_entries, whole_entries
from gridpeers.wire.bounds import LONGEST_MESSAGE
from gridpeers.wire.journal import Entry, Exchange, MessageReference, RejectedCount, SentMessage, Token

ENTRIES: list[Entry] = [
    Exchange(3, [b"measured", [1, 2.5, None]], [b"state", ["inv1", True]]),
    SentMessage(1.25, "control", bytes(range(256))),
    MessageReference(0.5, "state/inv1", 1, 7),
    MessageReference(None, "state/inv1", 1, 7, "late"),
    RejectedCount(2.0, "state/inv2", "garbled", 12),
    Token(None, "alive/agent/inv1/a", True),
]
PARTS = [msgspec.msgpack.encode(entry) for entry in ENTRIES]


def one_by_one(data: bytes) -> list[Entry]:
    """Return the entries up to the first that is none of ours."""
    found = []
    with suppress(ValueError):
        found += [entry for raw in raw_entries(data) if (entry := entry_of(raw)) is not None]
    return found


def test_a_sound_part_is_read_at_once() -> None:
    """All of its entries, in their order, as one by one; of none there are none."""
    data = b"".join(PARTS)

    assert whole_entries(data) == ENTRIES == one_by_one(data)
    assert whole_entries(b"") == []


@given(st.lists(st.sampled_from(PARTS), max_size=5), st.binary(max_size=6), st.integers(0, 60))
@example([PARTS[2]], b"\xc1", 60)
def test_what_is_read_at_once_is_what_is_read_one_by_one(parts: list[bytes], wrong: bytes, at: int) -> None:
    """Bytes that were put in somewhere make it None, or the same entries: never others."""
    whole = b"".join(parts)
    data = whole[:at] + wrong + whole[at:]
    entries = whole_entries(data)

    assert entries is None or list(entries) == one_by_one(data)


@pytest.mark.parametrize(
    "data",
    [PARTS[0][:-1], PARTS[1] + b"\x93", msgspec.msgpack.encode(["later", 1]) + PARTS[0], bytes(LONGEST_MESSAGE + 1)],
    ids=["cut off", "cut off later", "of a later version", "too long"],
)
def test_a_part_that_is_not_all_ours_is_left_to_one_by_one(data: bytes) -> None:
    """It is cut off, has an entry of a later version, or is longer than any part: the other way says what is wrong."""
    assert whole_entries(data) is None


def test_an_entry_that_took_in_the_next_one_is_damaged() -> None:
    """The number of its values is one too large: neither way of reading loses the next entry without a word."""
    for part in PARTS:
        data = bytes([part[0] + 1]) + part[1:] + PARTS[1]

        assert whole_entries(data) is None
        with pytest.raises(ValueError, match="has another one at its end"):
            list(entries_of(data))


@pytest.mark.parametrize("added", [b"\x07", b"\xa1\xff", b"\xd4\x05\x00"], ids=["number", "no UTF-8", "extension"])
def test_a_value_that_a_later_version_added_is_left_out(added: bytes) -> None:
    """The entry counts without it, if it can be read at all; both ways agree on what cannot."""
    data = bytes([PARTS[1][0] + 1]) + PARTS[1][1:] + added

    assert whole_entries(data) is None
    assert one_by_one(data) == ([] if added == b"\xa1\xff" else [ENTRIES[1]])


def test_what_can_be_read_of_a_part_with_an_entry_of_a_later_version_is_read() -> None:
    """The entry is left out, and those around it are there."""
    data = PARTS[1] + msgspec.msgpack.encode(["later", 1]) + PARTS[2]

    assert list(entries_of(data)) == [ENTRIES[1], ENTRIES[2]]


def test_behind_a_damaged_entry_the_others_are_read_if_its_error_is_taken() -> None:
    """A value of another form is told and left out; the bytes that end within an entry are told at last."""
    data = PARTS[1] + msgspec.msgpack.encode(["token", "no time"]) + PARTS[2] + PARTS[3][:-1]
    damage: list[ValueError] = []

    assert list(entries_of(data, damage.append)) == [ENTRIES[1], ENTRIES[2]]
    assert len(damage) == 2
    assert "within the entry" in str(damage[-1])
