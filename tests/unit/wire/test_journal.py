"""A journal notes messages and tokens, in parts, and has a bound on its size."""

from __future__ import annotations

from typing import Any

import pytest

from gridpeers.scenarios.record.journal_reader import entries_of
from gridpeers.wire.codec import encode
from gridpeers.wire.journal import (
    AT_ONCE,
    LOT,
    NOTED_REJECTED,
    ROOM,
    SHOWN_PAYLOAD,
    Entry,
    Exchange,
    JournalBuffer,
    MessageReference,
    ProcessEvent,
    ReceivedMessage,
    RejectedCount,
    SentMessage,
    TickTraffic,
    Token,
    Traffic,
    WakeUp,
)
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Leave, State


def noted(journal: JournalBuffer) -> list[Entry]:
    return [entry for part in journal.take_parts() for entry in entries_of(part)]


def test_a_part_ends_with_an_entry() -> None:
    """Many entries make several parts, each within the longest message, each readable on its own."""
    journal = JournalBuffer()
    entries = [SentMessage(None, f"key/{i}", bytes(1000)) for i in range(200)]
    for entry in entries:
        journal.add(entry)
    parts = journal.take_parts()

    assert len(parts) > 5
    assert all(len(part) < LOT + 2000 for part in parts)
    assert [entry for part in parts for entry in entries_of(part)] == entries


def test_a_flood_is_counted_and_not_kept() -> None:
    """A journal that nobody takes holds `ROOM` and says how many entries it has lost."""
    journal = JournalBuffer()
    for _ in range(3000):
        journal.add(SentMessage(None, "key", bytes(1000)))

    assert ROOM <= len(journal) < ROOM + 2000
    entries = noted(journal)
    lost = entries[-1]
    assert isinstance(lost, ProcessEvent)
    assert lost.kind == "lost"
    assert lost.text.startswith(f"{3000 - len(entries) + 1} entries")


KEYS = Keys("toy")
STATE = encode(State(sender="inv2", epoch=3, seq=5, t=0.1, P_set=5e4, V_set=277.0, Q=0.0))
LEAVE = encode(Leave(sender="inv2", epoch=3, seq=6, t=0.1))
NOISE = b"\x00" * (SHOWN_PAYLOAD + 7)


def timed(**options: Any) -> tuple[Traffic, JournalBuffer]:
    journal = JournalBuffer()
    return Traffic(KEYS, journal, **options), journal


def test_in_real_time_each_call_has_its_time() -> None:
    """A sent message and a line of the log have the time of the call that makes them."""
    traffic, journal = timed()
    traffic.process("start", "instance a", 9.0)
    traffic.token(KEYS.alive_agent("inv2", "b"), 9.5, appeared=True)
    traffic.received(KEYS.state("inv2"), STATE, 10.0, "")
    traffic.sent(KEYS.state("inv1"), STATE)
    traffic.woken(10.5)
    traffic.process("line", "joins")
    traffic.woken(11.0, work=True)
    traffic.sent(KEYS.leave("inv1"), LEAVE)
    traffic.token(KEYS.alive_agent("inv2", "b"), 11.5, appeared=False)

    assert noted(journal) == [
        ProcessEvent(9.0, "start", "instance a"),
        Token(9.5, "alive/agent/inv2/b", True),
        MessageReference(10.0, "state/inv2", 3, 5),
        SentMessage(10.0, "state/inv1", STATE),
        WakeUp(10.5),
        ProcessEvent(10.5, "line", "joins"),
        WakeUp(11.0, True),
        SentMessage(11.0, "leave/inv1", LEAVE),
        Token(11.5, "alive/agent/inv2/b", False),
    ]


def test_the_bytes_of_a_message_are_noted_once() -> None:
    """The sender and the plant note the bytes. Other receivers note only the number, also of a stale message."""
    for whole, rejected, entry in (
        (False, "", MessageReference(1.0, "state/inv2", 3, 5)),
        (False, "stale", MessageReference(1.0, "state/inv2", 3, 5, "stale")),
        (False, "ghost", ReceivedMessage(1.0, "state/inv2", STATE, "ghost")),
        (True, "", ReceivedMessage(1.0, "state/inv2", STATE)),
        (True, "stale", ReceivedMessage(1.0, "state/inv2", STATE, "stale")),
    ):
        traffic, journal = timed(whole=whole)
        traffic.received(KEYS.state("inv2"), STATE, 1.0, rejected)
        assert noted(journal) == [entry]


def test_of_a_rejected_message_the_beginning_is_noted() -> None:
    """A flood of long messages must not fill the record; one that was used is whole, whatever its length."""
    traffic, journal = timed()
    traffic.received(KEYS.state("inv2"), NOISE, 1.0, "corrupt")
    traffic.received(KEYS.link_request("inv1"), NOISE, 2.0, "")

    assert noted(journal) == [
        ReceivedMessage(1.0, "state/inv2", NOISE[:SHOWN_PAYLOAD], "corrupt"),
        ReceivedMessage(2.0, "link_request/inv1", NOISE),
    ]


def test_what_the_record_has_anyway_is_not_noted() -> None:
    """Not noted: messages that the plant publishes for recorders. Noted: rejected ones, and statuses at the plant."""
    for whole in (False, True):
        traffic, journal = timed(whole=whole)
        for key in (KEYS.telemetry, KEYS.journal("inv2"), KEYS.report("inv2"), KEYS.status("inv1"), KEYS.answer("z")):
            traffic.sent(key, b"it")
        for key in (KEYS.journal("inv2"), KEYS.report("inv2")):
            traffic.received(key, b"it", 1.0, "")
        assert noted(journal) == []
        traffic.received(KEYS.journal("inv2"), b"it", 1.0, "corrupt")
        traffic.received(KEYS.status("inv2"), b"it", 2.0, "")
        assert noted(journal) == [
            ReceivedMessage(1.0, "journal/inv2", b"it", "corrupt"),
            ReceivedMessage(2.0, "status/inv2", b"it"),
        ]


def test_in_ticks_the_plant_notes_a_tick_as_one_entry() -> None:
    """The entry has measurements and states in order. Other messages have own entries; an empty tick has none."""
    journal = JournalBuffer()
    traffic = TickTraffic(KEYS, ("inv1", "inv2"), journal)
    traffic.sent(KEYS.measurement("inv1"), b"m1")
    traffic.sent(KEYS.measurement("inv2"), b"m2")
    traffic.received(KEYS.state("inv2"), b"s2", 0.0, "")
    traffic.received(KEYS.state("inv1"), b"bad", 0.0, "corrupt")
    traffic.received(KEYS.state("inv1"), b"s1", 0.0, "")
    traffic.sent(KEYS.control, b"go")
    traffic.sent(KEYS.telemetry, b"rows")
    traffic.received(KEYS.journal("inv1"), b"part", 0.0, "")
    traffic.received(KEYS.ready("inv1"), b"ready", 0.0, "")
    traffic.token(KEYS.alive_agent("inv2", "b"), 0.0, appeared=True)
    traffic.process("line", "all are there")
    traffic.ticked(4)
    traffic.ticked(5)

    assert noted(journal) == [
        ReceivedMessage(None, "state/inv1", b"bad", "corrupt"),
        SentMessage(None, "control", b"go"),
        ReceivedMessage(None, "ready/inv1", b"ready"),
        Token(None, "alive/agent/inv2/b", True),
        ProcessEvent(None, "line", "all are there"),
        Exchange(4, [b"m1", b"m2"], [b"s2", b"s1"]),
    ]


@pytest.mark.parametrize("count", [AT_ONCE, AT_ONCE + 1, 2 * AT_ONCE + 3])
def test_the_messages_of_many_agents_are_several_entries(count: int) -> None:
    """Each message is in one of them, and none has more than fit into a part of a journal."""
    journal = JournalBuffer()
    traffic = TickTraffic(KEYS, ("inv1",), journal)
    for number in range(count):
        traffic.sent(KEYS.measurement("inv1"), b"m%d" % number)
        traffic.received(KEYS.state("inv1"), b"s%d" % number, 0.0, "")
    traffic.ticked(4)

    entries = [entry for entry in noted(journal) if isinstance(entry, Exchange)]
    assert len(entries) == -(-count // AT_ONCE)
    assert max(len(entry.states) for entry in entries) <= AT_ONCE
    assert [raw for entry in entries for raw in entry.measurements] == [b"m%d" % number for number in range(count)]
    assert [raw for entry in entries for raw in entry.states] == [b"s%d" % number for number in range(count)]


def test_a_flood_of_rejected_messages_does_not_fill_the_journal() -> None:
    """The first ones are noted with their bytes, the others only as a number for each key and kind."""
    journal = JournalBuffer()
    for traffic, at in ((Traffic(KEYS, journal), 10.0), (TickTraffic(KEYS, ("inv2",), journal), None)):
        for _ in range(2):
            for _ in range(1_000):
                traffic.received(KEYS.state("inv2"), NOISE, 10.0, "garbled")
                traffic.received(KEYS.ready("inv2"), STATE, 10.0, "")
            entries = noted(journal)

            assert sum(isinstance(entry, ReceivedMessage) for entry in entries) == 1_000 + NOTED_REJECTED
            assert entries[-1] == RejectedCount(at, "state/inv2", "garbled", 1_000 - NOTED_REJECTED)
