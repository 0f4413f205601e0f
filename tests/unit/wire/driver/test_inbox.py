"""What waits for a process that somebody floods with messages or tokens, and what wakes it."""

from __future__ import annotations

import pytest

from gridpeers.wire.codec import decode, encode, is_marked
from gridpeers.wire.driver.inbox import BYTES, MOST_OF_ONE, ROOM, Inbox
from gridpeers.wire.messages import LONGEST_MESSAGE, MESSAGES, Message, State
from gridpeers.wire.node import Loss
from tests.hostile.cases import packed, sound

LONG = bytes(LONGEST_MESSAGE)


def state(epoch: int, seq: int = 0) -> bytes:
    return encode(State(sender="inv2", epoch=epoch, seq=seq, t=0.0, P_set=0.0, V_set=0.0, Q=0.0))


def of_inv2(key: str, payload: bytes) -> bool:
    return is_marked(payload, "inv2", 7)


def events(inbox: Inbox) -> list[tuple[str, str]]:
    return [(kind, key) for kind, key, _, _ in inbox.take(1, 0.0)]


@pytest.mark.parametrize(("count", "timeout"), [(9, 30.0), (1, 0.01)])
def test_messages_are_taken_once_as_many_as_are_wanted_wait_or_the_time_is_over(count: int, timeout: float) -> None:
    """Those that were there before count too."""
    inbox = Inbox()
    for i in range(count):
        inbox.put(("message", str(i), b""))

    assert len(inbox.take(9, timeout)) == count


def test_a_flood_of_strangers_never_displaces_a_known_sender() -> None:
    """Of forty thousand of strangers' messages as many wait as there is room; the known sender's states all do."""
    inbox = Inbox()
    inbox.is_known = of_inv2
    strange = state(epoch=666)
    for i in range(10 * ROOM):
        inbox.put(("message", "state/inv2", strange))
        if i % (10 * ROOM // MOST_OF_ONE) == 0:
            inbox.put(("message", "state/inv2", state(epoch=7, seq=i)))
    inbox.put(("word", "SIGTERM", b""))
    *taken, word = inbox.take(1, 0.0)
    (loss,) = inbox.take_losses()

    assert word[0] == "word"
    assert len(taken) <= ROOM + MOST_OF_ONE
    assert sum(of_inv2("", payload) for _, _, payload, _ in taken) == MOST_OF_ONE
    assert loss == Loss("state/inv2", "excess", loss.text, 10 * ROOM + MOST_OF_ONE - len(taken))
    assert loss.text.startswith(f"{ROOM} messages were waiting, 0 bytes")
    assert inbox.take_losses() == ()


def test_a_known_sender_that_floods_has_its_own_room_and_no_more() -> None:
    """Of whoever copies name and epoch as many messages wait as of one sender; another key has its own room."""
    inbox = Inbox()
    inbox.is_known = of_inv2
    for i in range(2 * ROOM):
        inbox.put(("message", "state/inv2", state(epoch=7, seq=i)))
    inbox.put(("message", "set_points/inv2", state(epoch=7)))
    keys = [key for _, key in events(inbox)]

    assert keys.count("state/inv2") == ROOM + MOST_OF_ONE
    assert keys.count("set_points/inv2") == 1


def test_in_simulated_time_no_message_of_a_known_sender_is_lost() -> None:
    """Long ones and short ones come in beyond the room; those of strangers do not."""
    inbox = Inbox(lossless=True)
    inbox.is_known = lambda key, payload: key == "telemetry"
    for payload, count in ((LONG, 2 * BYTES // LONGEST_MESSAGE), (b"x", 2 * ROOM)):
        for _ in range(count):
            inbox.put(("message", "telemetry", payload))
        inbox.put(("message", "command", LONG))

    assert len(inbox.take(1, 0.0)) == 2 * BYTES // LONGEST_MESSAGE + 2 * ROOM
    assert [loss.number for loss in inbox.take_losses()] == [2]


@pytest.mark.parametrize("kind", MESSAGES)
def test_every_message_of_ours_is_recognised_by_its_first_bytes(kind: type[Message]) -> None:
    """With the longest name and the largest epoch; another epoch, or another name, is a stranger's."""
    name, epoch = "x" * 64, 2**53 - 1
    payload = encode(decode(packed(sound(kind, sender=name, epoch=epoch))))

    assert is_marked(payload, name, epoch)
    assert not is_marked(payload, name, epoch - 1)
    assert not is_marked(payload, name[1:], epoch)


def test_no_token_is_lost_in_a_flood_of_them() -> None:
    """Each comes in, and so does its end, in the order in which they came."""
    inbox = Inbox()
    tokens = [f"who{i}" for i in range(3 * ROOM)]
    for key in tokens:
        inbox.put(("appeared", key, b""))
    inbox.put(("vanished", tokens[0], b""))

    assert events(inbox) == [*(("appeared", key) for key in tokens), ("vanished", tokens[0])]
