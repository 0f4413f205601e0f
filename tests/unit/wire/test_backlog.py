"""What waits for a process that somebody floods, and what does not."""

from __future__ import annotations

import threading

import pytest

from gridpeers.wire.backlog import BYTES, MOST_OF_ONE, ROOM, SMALL, Backlog, Loss, is_marked
from gridpeers.wire.bounds import LONGEST_MESSAGE
from gridpeers.wire.codec import KINDS, decode, encode
from gridpeers.wire.driver.inbox import Inbox
from gridpeers.wire.messages import MESSAGES, Message, State
from tests.hostile.cases import packed, sound

LONG = bytes(LONGEST_MESSAGE)


def state(epoch: int, seq: int = 0) -> bytes:
    """Bytes of a state of inv2."""
    return encode(State(sender="inv2", epoch=epoch, seq=seq, t=0.0, P_set=0.0, V_set=0.0, Q=0.0))


def of_inv2(key: str, payload: bytes) -> bool:
    """Whether a message is of the process of inv2 that is believed."""
    return is_marked(payload, "inv2", 7)


def test_a_flood_of_strangers_never_displaces_a_known_sender() -> None:
    """Of forty thousand of strangers' messages as many wait as there is room; the known sender's states all do."""
    inbox = Inbox()
    inbox.is_known = of_inv2
    for i in range(10 * ROOM):
        inbox.put(("message", "state/inv2", state(epoch=666)))
        if i % (10 * ROOM // MOST_OF_ONE) == 0:
            inbox.put(("message", "state/inv2", state(epoch=7, seq=i)))
    taken = [payload for _, _, payload, _ in inbox.take(1, 0.0)]
    own = [payload for payload in taken if of_inv2("", payload)]
    (loss,) = inbox.take_losses()

    assert len(taken) <= ROOM + MOST_OF_ONE
    assert len(own) == MOST_OF_ONE
    assert (loss.key, loss.kind) == ("state/inv2", "excess")
    assert loss.number == 10 * ROOM + MOST_OF_ONE - len(taken)
    assert inbox.take_losses() == ()


def test_a_known_sender_that_floods_has_its_own_room_and_no_more() -> None:
    """Of whoever copies name and epoch as many messages wait as of one sender; another key has its own room."""
    inbox = Inbox()
    inbox.is_known = of_inv2
    for i in range(2 * ROOM):
        inbox.put(("message", "state/inv2", state(epoch=7, seq=i)))
    inbox.put(("message", "set_points/inv2", state(epoch=7)))
    keys = [key for _, key, _, _ in inbox.take(1, 0.0)]

    assert keys.count("state/inv2") == ROOM + MOST_OF_ONE
    assert keys.count("set_points/inv2") == 1


def test_tokens_and_words_always_come_in() -> None:
    """What is no message tells who is there, or that the process is asked to leave."""
    inbox = Inbox()
    for _ in range(2 * ROOM):
        inbox.put(("message", "state/inv2", b"x"))
    inbox.put(("vanished", "alive/plant/1", b""))
    inbox.put(("word", "SIGTERM", b""))

    assert [kind for kind, *_ in inbox.take(1, 0.0)][-2:] == ["vanished", "word"]


def test_long_messages_are_bounded_by_their_bytes() -> None:
    """Strangers have a quarter of the room, the known ones the rest; once taken out, there is room again."""
    inbox = Inbox()
    inbox.is_known = lambda key, payload: key == "telemetry"
    for key in ("command", "telemetry"):
        for _ in range(2 * BYTES // LONGEST_MESSAGE):
            inbox.put(("message", key, LONG))
    taken = inbox.take(1, 0.0)
    inbox.put(("message", "command", LONG))

    assert BYTES - LONGEST_MESSAGE <= sum(len(payload) for _, _, payload, _ in taken) <= BYTES
    assert sum(key == "command" for _, key, _, _ in taken) == BYTES // 4 // LONGEST_MESSAGE
    assert len(inbox.take(1, 0.0)) == 1


def test_in_simulated_time_a_known_sender_waits_for_room_and_loses_nothing() -> None:
    """The thread that brings messages stands still until the owner has read; so the sender is as slow as the owner."""
    inbox = Inbox(holds=True)
    inbox.is_known = lambda key, payload: True
    count = 2 * BYTES // LONGEST_MESSAGE

    def bring() -> None:
        for _ in range(count):
            inbox.put(("message", "telemetry", LONG))

    bringing = threading.Thread(target=bring)
    bringing.start()
    taken, most = 0, 0
    while taken < count:
        events = inbox.take(1, 5.0)
        taken, most = taken + len(events), max(most, len(events))
    bringing.join()

    assert taken == count
    assert most <= BYTES // LONGEST_MESSAGE + 1
    assert inbox.take_losses() == ()


def test_what_is_longer_than_a_message_never_waits() -> None:
    """The first is told with its length, all are counted."""
    inbox = Inbox()
    for length in (LONGEST_MESSAGE + 1, LONGEST_MESSAGE + 2):
        inbox.put(("message", "state/inv2", bytes(length)))
    text = f"{LONGEST_MESSAGE + 1} bytes, at most {LONGEST_MESSAGE} are allowed"

    assert inbox.take(1, 0.0) == []
    assert inbox.take_losses() == (Loss("state/inv2", "oversized", text, 2),)
    assert {"oversized", "excess"} <= set(KINDS)


@pytest.mark.parametrize("kind", MESSAGES)
def test_every_message_of_ours_is_recognised_by_its_first_bytes(kind: type[Message]) -> None:
    """With the longest name and the largest epoch; another epoch, or another name, is a stranger's."""
    name, epoch = "x" * 64, 2**53 - 1
    payload = encode(decode(packed(sound(kind, sender=name, epoch=epoch))))

    assert is_marked(payload, name, epoch)
    assert not is_marked(payload, name, epoch - 1)
    assert not is_marked(payload, name[1:], epoch)


def test_a_backlog_says_how_much_was_waiting() -> None:
    """The text of a loss has the numbers by which a person understands it."""
    backlog = Backlog()
    backlog.admits("telemetry", SMALL + 1, known=True, waiting=0)
    backlog.admits("state/inv2", 100, known=False, waiting=ROOM)
    (loss,) = backlog.take_losses()

    assert loss.text == f"{ROOM} messages were waiting, {SMALL + 1} bytes of them in long ones"
