"""The inbox of a process: floods of messages or tokens, and the end of a wait."""

from __future__ import annotations

import pytest

from gridpeers.wire.driver.inbox import BYTES, LOSSLESS, MOST_OF_ONE, ROOM, Inbox
from gridpeers.wire.messages import LONGEST_MESSAGE
from gridpeers.wire.node import Loss

LONG = bytes(LONGEST_MESSAGE)


def events(inbox: Inbox) -> list[tuple[str, str]]:
    return [(kind, key) for kind, key, _, _ in inbox.take(1, 0.0)]


@pytest.mark.parametrize(("count", "timeout"), [(9, 30.0), (1, 0.01)])
def test_messages_are_taken_once_as_many_as_are_wanted_wait_or_the_time_is_over(count: int, timeout: float) -> None:
    """Those that were there before count too."""
    inbox = Inbox()
    for i in range(count):
        inbox.put(("message", str(i), b""))

    assert len(inbox.take(9, timeout)) == count


@pytest.mark.parametrize("factor", [1, LOSSLESS])
def test_a_flood_on_one_key_displaces_nothing_on_another(factor: int) -> None:
    """Messages wait up to the common room; then each key has a small room of its own. Simulated time has more room."""
    inbox = Inbox(lossless=factor > 1)
    for _ in range(3 * factor * ROOM):
        inbox.put(("message", "state/inv2", b"x"))
    for _ in range(MOST_OF_ONE):
        inbox.put(("message", "state/inv3", b"y"))
    inbox.put(("word", "SIGTERM", b""))
    keys = [key for _, key in events(inbox)]
    (loss,) = inbox.take_losses()

    assert keys == ["state/inv2"] * factor * (ROOM + MOST_OF_ONE) + ["state/inv3"] * MOST_OF_ONE + ["SIGTERM"]
    assert loss == Loss("state/inv2", "excess", loss.text, factor * (2 * ROOM - MOST_OF_ONE))
    assert loss.text.startswith(f"{factor * (ROOM + MOST_OF_ONE)} messages were waiting, 0 bytes")
    assert inbox.take_losses() == ()


def test_long_messages_have_room_of_their_own() -> None:
    """Short messages wait beside long ones. A message above the limit is dropped."""
    inbox = Inbox()
    for _ in range(2 * BYTES // LONGEST_MESSAGE):
        inbox.put(("message", "telemetry", LONG))
    inbox.put(("message", "telemetry", b"x"))
    inbox.put(("message", "telemetry", LONG + b"x"))

    assert len(events(inbox)) == BYTES // LONGEST_MESSAGE + 1
    assert {loss.kind: loss.number for loss in inbox.take_losses()} == {
        "excess": BYTES // LONGEST_MESSAGE,
        "oversized": 1,
    }


def test_no_token_is_lost_in_a_flood_of_them() -> None:
    """Each token and its end arrive, in their order."""
    inbox = Inbox()
    tokens = [f"who{i}" for i in range(3 * ROOM)]
    for key in tokens:
        inbox.put(("appeared", key, b""))
    inbox.put(("vanished", tokens[0], b""))

    assert events(inbox) == [*(("appeared", key) for key in tokens), ("vanished", tokens[0])]
