"""What waits for a process that somebody floods with messages or tokens, and what wakes it."""

from __future__ import annotations

import pytest

from gridpeers.wire.bounds import LONGEST_MESSAGE
from gridpeers.wire.codec import decode, encode, is_marked
from gridpeers.wire.driver.inbox import BYTES, MOST_OF_ONE, MOST_TOKENS, ROOM, Inbox
from gridpeers.wire.messages import MESSAGES, Message, State
from gridpeers.wire.node import TOKENS, Loss
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


def test_of_a_flood_of_strangers_tokens_a_bounded_number_waits_and_the_rest_is_counted() -> None:
    """A noted holder is seen to go and to come back meanwhile; once they are taken there is room again."""
    inbox = Inbox()
    inbox.is_noted = lambda key: key == "inv2"
    for i in range(MOST_TOKENS + 5):
        inbox.put(("appeared", f"who{i}", b""))
    inbox.put(("vanished", "inv2", b""))
    inbox.put(("appeared", "inv2", b""))
    taken = events(inbox)
    (loss,) = inbox.take_losses()
    inbox.put(("appeared", "later", b""))

    assert len(taken) == MOST_TOKENS + 2
    assert taken[-2:] == [("vanished", "inv2"), ("appeared", "inv2")]
    assert loss == Loss(TOKENS, "excess", f"{MOST_TOKENS} tokens were waiting, of others", 5)
    assert events(inbox) == [("appeared", "later")]


def test_the_end_of_a_holder_comes_in_if_the_owner_has_noted_it_or_is_about_to() -> None:
    """What it has taken and not yet handled it may note; an end of which it saw no beginning is of no use."""
    inbox = Inbox()
    inbox.is_noted = lambda key: False
    for token in ("a", "b", "a"):  # the third says nothing new
        inbox.put(("appeared", token, b""))
    inbox.put(("vanished", "a", b""))
    inbox.put(("vanished", "stranger", b""))

    assert events(inbox) == [("appeared", "a"), ("appeared", "b"), ("vanished", "a")]
    inbox.put(("vanished", "b", b""))
    inbox.put(("vanished", "a", b""))
    assert events(inbox) == [("vanished", "b")]
