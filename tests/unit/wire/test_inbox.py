from __future__ import annotations

from wire.driver.inbox import Inbox


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
