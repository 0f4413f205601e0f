"""Bound the messages that wait for a process, and count those that may not. Pure.

A process takes its messages out at every tick. Should it fall behind, or somebody send faster than it reads, then

- up to `ROOM` short messages wait, whoever sent them;
- beyond that a message waits only if it is of a known sender, up to `MOST_OF_ONE` on each key. So a flood by others
  never displaces a state, a measurement or a stop request;
- messages above `SMALL` bytes have `BYTES` together, a quarter of it for strangers.

A known sender is recognised by its name and epoch in the first bytes, as `gridpeers.wire.codec` writes them; nothing is
decoded here. That is no proof of anything: all checks of `gridpeers.wire.node` follow. Whoever copies name and epoch
has the room of that one sender, and no more.
"""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from typing import NamedTuple

import msgspec

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
    """Whether a payload begins as a message of this sender in this epoch does.

    Examples
    --------
    >>> from gridpeers.wire.codec import encode
    >>> from gridpeers.wire.messages import Ready
    >>> payload = encode(Ready(sender="inv1", epoch=7, seq=0, t=0.0))
    >>> is_marked(payload, "inv1", 7), is_marked(payload, "inv1", 8)
    (True, False)
    """
    return _mark(sender, epoch) in payload[:_HEAD]


class Backlog:
    """Decide which messages may wait, from the size of each and what waits already.

    Examples
    --------
    >>> backlog = Backlog()
    >>> backlog.admits("state/inv2", 120, known=False, waiting=ROOM - 1)
    True
    >>> backlog.admits("state/inv2", 120, known=False, waiting=ROOM)
    False
    >>> backlog.admits("state/inv2", 120, known=True, waiting=ROOM)
    True
    >>> [(loss.key, loss.kind, loss.number) for loss in backlog.take_losses()]
    [('state/inv2', 'excess', 1)]
    """

    def __init__(self) -> None:
        self._beyond: Counter[str] = Counter()
        """Messages that wait beyond `ROOM`, by key."""
        self._bytes = 0
        """Bytes of the long messages that wait."""
        self._losses: dict[tuple[str, str], Loss] = {}

    def admits(self, key: str, size: int, *, known: bool, waiting: int) -> bool:
        """Return whether a message may wait; count it as lost if not.

        Parameters
        ----------
        key : str
            Its key.
        size : int
            Its bytes.
        known : bool
            Whether it is of a known sender, or answers an own question.
        waiting : int
            Messages that wait already.
        """
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
