"""A journal: entries in parts, none cut in two, and a bound on what it holds."""

from __future__ import annotations

from gridpeers.scenarios.record.journal_reader import entries_of
from gridpeers.wire.journal import LOT, ROOM, Entry, Exchange, JournalBuffer, ProcessEvent, SentMessage, Token


def read(parts: list[bytes]) -> list[Entry]:
    return [entry for part in parts for entry in entries_of(part)]


def test_entries_come_back_as_they_were_noted() -> None:
    """Each entry, in its order, with bytes and None as they were."""
    noted = [
        Token(None, "alive/agent/inv1/a", True),
        Exchange(3, [b"measured"], [b"state", b"other"]),
        SentMessage(1.25, "control", bytes(range(256))),
    ]
    journal = JournalBuffer()
    for entry in noted:
        journal.add(entry)

    assert read(journal.take_parts()) == noted
    assert journal.take_parts() == []


def test_a_part_ends_with_an_entry() -> None:
    """Many entries make several parts, each within the longest message, each readable on its own."""
    journal = JournalBuffer()
    noted = [SentMessage(None, f"key/{i}", bytes(1000)) for i in range(200)]
    for entry in noted:
        journal.add(entry)
    parts = journal.take_parts()

    assert len(parts) > 5
    assert all(len(part) < LOT + 2000 for part in parts)
    assert [len(list(entries_of(part))) > 0 for part in parts] == [True] * len(parts)
    assert read(parts) == noted


def test_a_flood_is_counted_and_not_kept() -> None:
    """A journal that nobody takes holds `ROOM` and says how many entries it has lost."""
    journal = JournalBuffer()
    for _ in range(3000):
        journal.add(SentMessage(None, "key", bytes(1000)))

    assert ROOM <= len(journal) < ROOM + 2000
    entries = read(journal.take_parts())
    lost = entries[-1]
    assert isinstance(lost, ProcessEvent)
    assert lost.kind == "lost"
    assert lost.text.startswith(f"{3000 - len(entries) + 1} entries")
