"""What waits for a process that somebody floods with messages or tokens, in which order, and what does not."""

from __future__ import annotations

import threading
from collections import Counter
from itertools import pairwise
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gridpeers.wire.backlog import (
    AT_ONCE,
    BYTES,
    MOST_OF_ONE,
    MOST_WAITING,
    PAUSE,
    ROOM,
    SMALL,
    TOKENS,
    Backlog,
    Loss,
    TokenEvent,
    TokenQueue,
    is_marked,
)
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


FEW, RATE = 5, 3
"""Strangers' tokens that may wait in the drawn sequences, and those that come in at once."""

MEMBERS, WELCOME, REFUSED = ("m0", "m1"), ("w0", "w1", "w2"), tuple(f"s{i}" for i in range(40))

Seen = tuple[TokenEvent, int]
"""An event that came in, and which token of its key it is about: each that is held after another has a new number."""


class Process:
    """A process that notes some holders, handles what it takes with delay, and knows the truth for comparison."""

    def __init__(self) -> None:
        self.queue, self.now = TokenQueue(), 0.0
        self.pending: list[tuple[TokenEvent, str]] = []
        """Events that have come in and are not taken yet."""
        self.taken: list[tuple[TokenEvent, str]] = []
        """Events that it has taken and not handled yet."""
        self.noted: set[str] = set()
        self.there: set[str] = set()
        """Tokens that are held."""
        self.unseen: set[str] = set()
        """Those of them that were dropped."""
        self.number: Counter[str] = Counter()
        self.seen: dict[str, list[Seen]] = {}
        """Events of each key in the order in which they came in."""
        self.announced = self.annihilated = self.lost = 0

    def flip(self, key: str) -> None:
        """Hold a token, or give it up."""
        if key not in self.there:
            self.there.add(key)
            self.number[key] += 1
            self.announce(key)
            return
        waiting, last = self.queue.waiting, self.seen.get(key, [])[-1:]
        self.there.discard(key)
        self.unseen.discard(key)
        comes = self.queue.put("vanished", key, self.now, self.noted.__contains__)
        self.annihilated += waiting - self.queue.waiting
        if key in MEMBERS:  # its end is never lost, and never told of a token that never came
            assert comes == (last == [("appeared", self.number[key])])
        self._come("vanished", key, comes)

    def announce(self, key: str) -> None:
        """Have a token that is held announced, perhaps once more, as by a second link."""
        if key not in self.there:
            return
        waiting, owed = self.queue.waiting, key in self.noted or key in {each for _, each in self.taken + self.pending}
        comes = self.queue.put("appeared", key, self.now, self.noted.__contains__)
        lost = sum(loss.number for loss in self.queue.take_loss())
        self.lost += lost
        self.announced += comes + lost + self.queue.waiting - waiting  # or it waits already, and that is all
        self._come("appeared", key, comes)
        if lost:
            assert key not in MEMBERS or not owed or self.seen[key][-1] == ("appeared", self.number[key])
            self.unseen.add(key)
        beyond = len(MEMBERS + WELCOME) + 2 * RATE  # those that are noted, or about to be
        assert self.queue.waiting <= FEW + beyond

    def take(self, after: float) -> None:
        """Handle what was taken before, and take what is there."""
        self.now += after
        for kind, key in self.taken:
            if kind == "appeared" and key in MEMBERS + WELCOME:
                self.noted.add(key)
            elif kind == "vanished":
                self.noted.discard(key)
        self.taken, self.pending = self.pending, []
        for _, key, _, at in self.queue.taken(self.now):
            assert at <= self.now
            self._come("appeared", key, True)
        self.taken, self.pending = self.taken + self.pending, []
        assert sum(kind == "appeared" for kind, _ in self.taken) <= 2 * RATE

    def _come(self, kind: TokenEvent, key: str, comes: bool) -> None:
        if comes:
            self.pending.append((kind, key))
            self.seen.setdefault(key, []).append((kind, self.number[key]))
            self.unseen.discard(key)


KEY = st.sampled_from(MEMBERS + WELCOME + REFUSED)

STEP = st.one_of(
    st.tuples(st.just("flip"), st.sampled_from(MEMBERS + WELCOME)),
    st.tuples(st.just("announce"), st.sampled_from(MEMBERS + WELCOME)),
    st.tuples(st.just("strangers"), st.integers(0, 30)),
    st.tuples(st.just("flip"), KEY),
    st.tuples(st.just("take"), st.sampled_from((0.0, PAUSE))),
)


@given(st.lists(STEP, max_size=100))
def test_nobody_who_is_noted_goes_or_comes_unseen_whatever_strangers_do(steps: list[tuple[str, Any]]) -> None:
    """In any order of tokens and takes: no end is lost, no two change places, what waits is bounded, all is counted."""
    with patch("gridpeers.wire.backlog.MOST_WAITING", FEW), patch("gridpeers.wire.backlog.AT_ONCE", RATE):
        process = Process()
        for key in MEMBERS:
            process.flip(key)
        process.take(0.0)
        process.take(PAUSE)
        for step, what in steps:
            if step == "flip":
                process.flip(what)
            elif step == "announce":
                process.announce(what)
            elif step == "take":
                process.take(what)
            else:
                for key in REFUSED[what : what + 10]:
                    process.flip(key)
        for _ in range(20):
            process.take(PAUSE)

    for key, events in process.seen.items():
        assert events[0][0] == "appeared"
        if key not in REFUSED:  # the end of who is not noted is of no use
            for (kind, number), (following, its) in pairwise(events):
                assert kind != following or (following == "appeared" and number == its), (key, events)
    there = process.there - process.unseen
    assert process.noted & {*MEMBERS} >= there & {*MEMBERS}
    assert process.noted <= process.there  # nobody is believed to be there who has gone
    arrived = sum(kind == "appeared" for events in process.seen.values() for kind, _ in events)
    assert process.announced == arrived + process.annihilated + process.lost
    assert process.queue.waiting == 0
    assert process.queue.is_idle


def test_who_is_noted_and_announced_again_is_seen_to_go_while_that_waits() -> None:
    """A second link announces a token once more; behind strangers that waits, and the end comes in all the same."""
    queue = TokenQueue()
    for i in range(AT_ONCE + 1):
        queue.put("appeared", f"who{i}", 0.0, lambda key: False)
    queue.put("appeared", "inv2", 0.0, lambda key: key == "inv2")

    assert queue.put("vanished", "inv2", 0.0, lambda key: key == "inv2")
    assert queue.waiting == 1
    assert not queue.put("vanished", "inv2", 0.0, lambda key: key == "inv2")


def test_of_a_flood_of_strangers_a_bounded_number_waits_and_the_rest_is_counted() -> None:
    """A hundred thousand tokens: so many come in at once, so many wait, the others are one loss with their number."""
    queue, count = TokenQueue(), 100_000
    came = sum(queue.put("appeared", f"who{i}", 0.0, lambda key: False) for i in range(count))
    (loss,) = queue.take_loss()

    assert (came, queue.waiting) == (AT_ONCE, MOST_WAITING)
    assert (loss.kind, loss.number) == ("excess", count - AT_ONCE - MOST_WAITING)
    assert loss.key == TOKENS
    assert queue.take_loss() == ()


def test_who_restarts_in_a_flood_of_strangers_is_seen_to_go_at_once_and_to_come_once_there_is_room() -> None:
    """Its end does not wait behind the strangers; its return does, and is not dropped though their room is full."""
    queue = TokenQueue()
    for i in range(2 * MOST_WAITING):
        queue.put("appeared", f"who{i}", 0.0, lambda key: False)

    assert queue.put("vanished", "inv2", 0.0, lambda key: key == "inv2")
    assert not queue.put("appeared", "inv2", 0.0, lambda key: key == "inv2")
    came, now = [], 0.0
    while queue.waiting:
        came += [key for _, key, _, _ in queue.taken(now)]
        now += PAUSE
    assert came[-1] == "inv2"
    assert len(came) == MOST_WAITING + 1


def test_strangers_that_come_and_go_while_they_wait_leave_nothing() -> None:
    """A million tokens that appear and vanish keep no room, and their ends are not told."""
    queue = TokenQueue()
    for i in range(AT_ONCE):
        queue.put("appeared", f"first{i}", 0.0, lambda key: False)
    for i in range(2 * MOST_WAITING):
        assert not queue.put("appeared", f"who{i}", 0.0, lambda key: False)
        assert not queue.put("vanished", f"who{i}", 0.0, lambda key: False)

    assert queue.waiting == 0
    assert queue.take_loss() == ()


def test_an_inbox_wakes_its_owner_for_tokens_that_wait() -> None:
    """An owner that sleeps till its messages come gets all tokens all the same, a few at a time, and in their order."""
    inbox = Inbox()
    inbox.is_noted = lambda key: False
    for i in range(3 * AT_ONCE):
        inbox.put(("appeared", f"who{i}", b""))
    inbox.put(("vanished", "who0", b""))
    inbox.put(("vanished", f"who{3 * AT_ONCE - 1}", b""))
    taken: list[list[tuple[str, str]]] = []
    while sum(map(len, taken)) < 3 * AT_ONCE:
        taken.append([(kind, key) for kind, key, _, _ in inbox.take(10**9, None)])
    expected = [("appeared", f"who{i}") for i in range(3 * AT_ONCE - 1)]
    expected.insert(AT_ONCE, ("vanished", "who0"))

    assert [event for events in taken for event in events] == expected
    assert max(map(len, taken)) <= 2 * AT_ONCE
    assert inbox.take_losses() == ()


def test_an_owner_that_has_said_nothing_of_whom_it_notes_loses_no_token() -> None:
    """Of as many as it likes: then nobody counts as a stranger."""
    inbox = Inbox()
    for i in range(AT_ONCE + 1):
        inbox.put(("appeared", f"a{i}", b""))
    with patch("gridpeers.wire.backlog.MOST_WAITING", 1):
        inbox.put(("appeared", "b", b""))
        inbox.put(("vanished", "c", b""))
    kinds = []
    while len(kinds) < AT_ONCE + 3:
        kinds += [kind for kind, *_ in inbox.take(10**9, None)]

    assert kinds.count("appeared") == AT_ONCE + 2
    assert inbox.take_losses() == ()


def test_a_message_waits_behind_the_tokens_that_came_before_it() -> None:
    """Its sender's token may be the last of them; messages of known senders and answers to own questions pass."""
    inbox = Inbox()
    inbox.is_known = lambda key, payload: key == "state/inv1"
    inbox.is_noted = lambda key: False
    tokens = [f"who{i}" for i in range(AT_ONCE + 4)] + ["plant"]
    for token in tokens:
        inbox.put(("appeared", token, b""))
    inbox.put(("message", "control", b"Prepare"))
    for i in range(AT_ONCE):
        inbox.put(("appeared", f"later{i}", b""))
    inbox.put(("message", "state/inv1", b"State"))
    inbox.put(("message", "nameplate/inv2", b"Nameplate"), asked=True)
    first = [key for _, key, _, _ in inbox.take(10**9, None)]
    rest: list[str] = []
    while len(rest) < 5 + 1 + AT_ONCE - len(first[AT_ONCE + 2 :]):
        rest += [key for _, key, _, _ in inbox.take(10**9, None)]

    assert first[: AT_ONCE + 2] == [*tokens[:AT_ONCE], "state/inv1", "nameplate/inv2"]
    assert (first[AT_ONCE + 2 :] + rest)[:6] == [*tokens[AT_ONCE:], "control"]


def test_messages_behind_tokens_take_their_part_of_the_room() -> None:
    """Strangers who send behind their own tokens cannot fill the memory: beyond the room all is lost and counted."""
    inbox = Inbox()
    inbox.is_noted = lambda key: False
    for i in range(AT_ONCE + 1):
        inbox.put(("appeared", f"who{i}", b""))
    for _ in range(ROOM + 5):
        inbox.put(("message", "control", b"x"))

    assert [loss.number for loss in inbox.take_losses()] == [AT_ONCE + 5]
    taken = 0
    while taken < ROOM + 1:
        taken += len(inbox.take(10**9, None))
