from __future__ import annotations

import threading

import pytest

import gridpeers.wire.driver.inbox
from gridpeers.wire.backlog import BYTES, MOST_OF_ONE, ROOM
from gridpeers.wire.bounds import LONGEST_MESSAGE
from gridpeers.wire.driver.inbox import Inbox

LONG = bytes(LONGEST_MESSAGE)


def test_what_is_no_message_is_taken_at_once_whenever_it_came() -> None:
    """A token or word that came while the owner computed does not wait for the messages that are wanted."""
    inbox = Inbox()
    inbox.take(1, timeout=0.0)
    inbox.put(("vanished", "a", b""))

    assert [event[:3] for event in inbox.take(9, timeout=30.0)] == [("vanished", "a", b"")]
    assert inbox.take(9, timeout=0.0) == []


def test_wanted_messages_are_taken_at_once_whenever_they_came() -> None:
    """As many messages as are wanted are not waited for again."""
    inbox = Inbox()
    for i in range(9):
        inbox.put(("message", str(i), b""))

    assert len(inbox.take(9, timeout=30.0)) == 9


def test_fewer_messages_than_wanted_come_after_the_time() -> None:
    """A deadline brings what there is."""
    inbox = Inbox()
    inbox.put(("message", "a", b""))

    assert [event[:3] for event in inbox.take(9, timeout=0.01)] == [("message", "a", b"")]


@pytest.mark.timeout(60)
def test_many_senders_that_wait_for_room_all_go_on_once_there_is_some(monkeypatch: pytest.MonkeyPatch) -> None:
    """None is forgotten, no more come in than there is room for, and the owner is woken though it wants more."""
    monkeypatch.setattr(gridpeers.wire.driver.inbox, "HELD", 3600.0)
    inbox = Inbox(holds=True)
    inbox.is_known = lambda key, payload: True
    each, senders = 4 * BYTES // LONGEST_MESSAGE // 8, 8

    def bring(key: str) -> None:
        for _ in range(each):
            inbox.put(("message", key, LONG))

    bringing = [threading.Thread(target=bring, args=(f"telemetry/{i}",), daemon=True) for i in range(senders)]
    for thread in bringing:
        thread.start()
    taken = []
    while sum(taken) < each * senders:
        wanted = min(each * senders - sum(taken), 3 * BYTES // LONGEST_MESSAGE)
        taken.append(len(inbox.take(wanted, None)))
    for thread in bringing:
        thread.join()

    assert max(taken) <= BYTES // LONGEST_MESSAGE
    assert inbox.take_losses() == ()


@pytest.mark.timeout(60)
def test_senders_of_short_messages_wait_for_room_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """On one key, beyond the room for all, as many wait as of one sender."""
    monkeypatch.setattr(gridpeers.wire.driver.inbox, "HELD", 3600.0)
    inbox = Inbox(holds=True)
    inbox.is_known = lambda key, payload: True
    count = 3 * ROOM

    def bring() -> None:
        for _ in range(count):
            inbox.put(("message", "state/inv2", b"x"))

    bringing = threading.Thread(target=bring, daemon=True)
    bringing.start()
    taken = []
    while sum(taken) < count:
        taken.append(len(inbox.take(count - sum(taken), None)))
    bringing.join()

    assert max(taken) <= ROOM + MOST_OF_ONE


def test_a_message_that_has_waited_too_long_for_room_comes_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """In simulated time none may be lost; once taken out, all of the room is there again."""
    monkeypatch.setattr(gridpeers.wire.driver.inbox, "HELD", 0.0)
    inbox = Inbox(holds=True)
    inbox.is_known = lambda key, payload: key == "telemetry"
    room = BYTES // LONGEST_MESSAGE
    for _ in range(room + 2):
        inbox.put(("message", "telemetry", LONG))

    assert len(inbox.take(1, 0.0)) == room + 2
    for _ in range(room):
        inbox.put(("message", "command", LONG))
    assert len(inbox.take(1, 0.0)) == room // 4
    assert [loss.number for loss in inbox.take_losses()] == [room - room // 4]
