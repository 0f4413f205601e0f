"""What waits for a process, and what may not: messages and liveliness tokens. Pure.

A process takes its messages out at every tick. Should it fall behind, or somebody send faster than it reads, then

- up to `ROOM` short messages wait, whoever sent them;
- beyond that a message waits only if it is of a known sender, up to `MOST_OF_ONE` on each key. So a flood by others
  never displaces a state, a measurement or a stop request;
- messages above `SMALL` bytes have `BYTES` together, a quarter of it for strangers.

A known sender is recognised by its name and epoch in the first bytes; whoever copies these has the room of that one
sender, and no more. All checks of `gridpeers.wire.node` follow.

Anybody may hold tokens, as many as he likes, and each costs the process that notes it a question. So

- of the tokens that appear, `AT_ONCE` come in at once and as many after each `PAUSE`; the others wait, in their order;
- a message whose sender is not known waits behind the tokens that came before it: one of them may be its sender's;
- up to `MOST_WAITING` of strangers wait; one more is dropped and counted. One of a noted holder always waits;
- a token that vanishes comes in at once if its holder is noted, and is of no use if not; a waiting one is forgotten.

So a noted holder is always seen to go, and to come back. What has come in is noted only once the process has handled
it (`gridpeers.wire.node.Node.is_noted`), so until then it is remembered here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from itertools import count
from math import inf
from typing import Literal, NamedTuple

import msgspec

from gridpeers.wire.bounds import MOST_INVERTERS
from gridpeers.wire.membership import MOST_PROCESSES

ROOM = 4_000
"""Short messages that may wait, of anybody: four for each of the most inverters in a run."""

SMALL = 4_096
"""Bytes of a short message; the longer ones are reports, journals and telemetry."""

MOST_OF_ONE = 64
"""Messages of one known sender that may wait beyond `ROOM` on one key: more than a second of its states."""

BYTES = 64_000_000
"""Bytes of long messages that may wait."""

_HEAD = 160
"""Bytes in which type, name and epoch stand."""

_encode = msgspec.msgpack.Encoder().encode


class Loss(NamedTuple):
    """Messages on one key, or tokens, that were dropped unread."""

    key: str
    kind: str
    """One of `gridpeers.wire.codec.KINDS`."""
    text: str
    """The problem of the first of them."""
    number: int


@lru_cache(maxsize=4096)
def _mark(sender: str, epoch: int) -> bytes:
    return b"\xa6sender" + _encode(sender) + b"\xa5epoch" + _encode(epoch)


def is_marked(payload: bytes, sender: str, epoch: int) -> bool:
    """Whether a payload begins as a message of this sender in this epoch does."""
    return _mark(sender, epoch) in payload[:_HEAD]


class Backlog:
    """Decide which messages may wait, from the size of each and what waits already."""

    def __init__(self) -> None:
        self._beyond: Counter[str] = Counter()
        """Messages that wait beyond `ROOM`, by key."""
        self._bytes = 0
        """Bytes of the long messages that wait."""
        self._losses: dict[tuple[str, str], Loss] = {}

    def admits(self, key: str, size: int, *, known: bool, waiting: int) -> bool:
        """Return whether a message may wait, `known` if it answers an own question; count it as lost if not."""
        if not self.has_room(key, size, known=known, waiting=waiting):
            self.lose(key, "excess", f"{waiting} messages were waiting, {self._bytes} bytes of them in long ones")
            return False
        self.add(key, size, waiting=waiting)
        return True

    def add(self, key: str, size: int, *, waiting: int) -> None:
        """Note a message that waits."""
        self._beyond[key] += waiting >= ROOM
        self._bytes += size if size > SMALL else 0

    def has_room(self, key: str, size: int, *, known: bool, waiting: int) -> bool:
        """Return whether a message may wait."""
        if size > SMALL and self._bytes + size > (BYTES if known else BYTES // 4):
            return False
        return waiting < ROOM or (known and self._beyond[key] < MOST_OF_ONE)

    def lose(self, key: str, kind: str, text: str) -> None:
        """Count a message that is dropped unread."""
        first = self._losses.get((key, kind))
        self._losses[key, kind] = Loss(key, kind, text, 1) if first is None else first._replace(number=first.number + 1)

    def emptied(self, bytes_left: int = 0) -> None:
        """Note that nothing waits any more, but for so many bytes of messages behind tokens."""
        self._beyond.clear()
        self._bytes = bytes_left

    @property
    def has_losses(self) -> bool:
        """Whether there are losses to take."""
        return bool(self._losses)

    def take_losses(self) -> tuple[Loss, ...]:
        """Take out the losses since the last call."""
        losses, self._losses = tuple(self._losses.values()), {}
        return losses


TokenEvent = Literal["appeared", "vanished"]

Kind = Literal["message", "appeared", "vanished", "word"]
"""A message or answer; a token that appeared or vanished; or a word from another thread of the own process."""

Stamped = tuple[Kind, str, bytes, float]
"""Kind, key and payload of an event, and its time of arrival (s, monotonic): it may wait for its owner."""

AT_ONCE, PAUSE = 20, 0.01
"""Appearing tokens that come in at once, and time (s) after which as many more do: 2,000 a second, of which each costs
some 0.1 ms. The agents of the largest run are known within half a second, and no step waits for more than 20."""

MOST_WAITING = MOST_PROCESSES * MOST_INVERTERS
"""Strangers' tokens that may wait: as many as a process would note of all names together."""

TOKENS = "alive/**"
"""Key under which all tokens that are dropped are counted, as there are as many of their own as anybody likes."""


class TokenQueue:
    """The tokens that appear to a process, and vanish.

    The owner calls `taken` once it has handled all that came in before, and has taken out all that came in since.
    """

    def __init__(self) -> None:
        self._waiting: dict[str | int, Stamped] = {}
        """What waits, in its order: tokens by their keys, messages by a number."""
        self._numbers = count()
        self.messages = self.message_bytes = 0
        """Messages that wait, and their bytes."""
        self._came: dict[str, bool] = {}
        """Whether each token is there, as the owner will see by what has come in since it took the last events."""
        self._handled: dict[str, bool] = {}
        """The same by the events that it took then, and handles now."""
        self._room, self._renewal = AT_ONCE, -inf
        """Tokens that may yet come in before the next renewal of the room, and the time (s) of that."""
        self._loss: Loss | None = None

    def put(self, event: TokenEvent, key: str, at: float, is_noted: Callable[[str], bool]) -> bool:
        """Take an event at a time (s); return whether it comes in now."""
        there = self._came.get(key, self._handled.get(key))
        if event == "vanished":
            self._waiting.pop(key, None)  # one that is announced again waits although its holder is noted
            if not (is_noted(key) if there is None else there):
                return False
            self._came[key] = False
            return True
        if key in self._waiting:
            return False
        if not self._came:  # else an owner that is busy would have ever more to handle at once
            self._renew(at)
        if self._room and not self._waiting:
            self._come(key)
            return True
        if self._waiting_tokens < MOST_WAITING or there is False or (there is None and is_noted(key)):
            self._waiting[key] = "appeared", key, b"", at
        else:
            self._lose()
        return False

    def put_behind(self, message: Stamped) -> None:
        """Let a message wait until all tokens that wait now have come in."""
        self._waiting[next(self._numbers)] = message
        self.messages += 1
        self.message_bytes += len(message[2])

    def taken(self, now: float) -> list[Stamped]:
        """Note that the owner has handled what it took before, and has taken all that came in; let more come in."""
        self._handled, self._came = self._came, {}
        self._renew(now)
        arrivals: list[Stamped] = []
        while self._waiting:
            first = next(iter(self._waiting))
            if isinstance(first, str):
                if not self._room:
                    break
                self._come(first)
            else:
                self.messages -= 1
                self.message_bytes -= len(self._waiting[first][2])
            arrivals.append(self._waiting.pop(first))
        self._handled.update(self._came)
        self._came = {}
        return arrivals

    @property
    def is_idle(self) -> bool:
        """Whether there is nothing for `taken` to do."""
        return not (self._waiting or self._came or self._handled)

    @property
    def due(self) -> float:
        """When the next of those that wait may come in (s); infinite if none waits."""
        return self._renewal if self._waiting else inf

    @property
    def waiting(self) -> int:
        """Number of tokens and messages that wait."""
        return len(self._waiting)

    @property
    def _waiting_tokens(self) -> int:
        return len(self._waiting) - self.messages

    @property
    def has_loss(self) -> bool:
        """Whether tokens were dropped since the last `take_loss`."""
        return self._loss is not None

    def take_loss(self) -> tuple[Loss, ...]:
        """Take out the tokens that were dropped since the last call, as one loss."""
        loss, self._loss = self._loss, None
        return () if loss is None else (loss,)

    def _renew(self, now: float) -> None:
        if now >= self._renewal:
            self._room, self._renewal = AT_ONCE, now + PAUSE

    def _lose(self) -> None:
        if self._loss is None:
            self._loss = Loss(TOKENS, "excess", f"{self._waiting_tokens} tokens were waiting, of others", 0)
        self._loss = self._loss._replace(number=self._loss.number + 1)

    def _come(self, key: str) -> None:
        self._room -= 1
        self._came[key] = True
