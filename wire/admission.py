"""Whose messages count: who speaks for a name, in which epoch, and how far its numbers have come. Pure.

Both sides ask this of every message, in both kinds of time: as it comes off the wire and, of one that an emulated link
kept, once more as it is let through.

- A *name* is spoken for under its own keys only.
- An *epoch* (`epoch` in messages) is the life of one process, which is known by its token. The plant's token
  carries it; an agent tells it in the nameplate that is asked of the one process that holds the token. It is learnt
  once. What comes in any other epoch is a ghost's. Two epochs are equal or not; which of them is greater does not
  matter, so no host's clock decides who is believed.
- *Numbers* rise within an epoch. A number far ahead would mute its sender for good, so one that goes on behind it is
  believed again after a while.

Nothing here is proof against somebody who listens and then lies under another's name, in its epoch and with its next
number: that needs keys and certificates, which Zenoh has (docs/protocol.md).
"""

from __future__ import annotations

from math import inf

from wire.codec import RejectedError
from wire.messages import AnyMessage

AHEAD = 50
"""Numbers by which a sender may be ahead of its run time: it may have sent some at once."""

FASTER = 2.0
"""So many times as often as itself a receiver in wall-clock time believes others to send at most."""

PERSISTENT = 50
"""Messages in a row, rising, after which a sender is believed against a higher number: a second at 20 ms."""


class Admission:
    """Who speaks for each name.

    Parameters
    ----------
    rate : float, optional
        Most messages of one sender per s of run time: of more that are missing, none are counted. In simulated time
        numbers are ticks, which are awaited one by one.

    Examples
    --------
    >>> from wire.messages import Ready
    >>> admission, ready = Admission(), Ready(sender="inv1", epoch=7, seq=0, t=0.0)
    >>> admission.bind("inv1", 7)
    >>> admission.check(ready)
    >>> admission.bind("inv1", 3)
    >>> admission.check(ready)
    Traceback (most recent call last):
        ...
    wire.codec.RejectedError: Ready(0) of epoch 7 of inv1, who lives in epoch 3
    """

    def __init__(self, rate: float = inf) -> None:
        self._rate = rate
        self._epochs: dict[str, int] = {}
        """Of each name that somebody speaks for now."""
        self._numbered: dict[str, int] = {}
        """The epoch of the numbers below; it outlasts a token that goes and comes back."""
        self._came: dict[str, tuple[int, float]] = {}
        """Number and run time (s) of the last message that came off the wire."""
        self._behind: dict[str, tuple[int, int]] = {}
        """Number of the last message that came after a later one, and how many such came in a row."""
        self._passed: dict[str, int] = {}
        """Number of the last message that was of use."""

    def bind(self, name: str, epoch: int) -> None:
        """Learn that the process which counts for a name lives in an epoch; in a new one numbers begin anew."""
        if self._numbered.get(name) != epoch:
            self._numbered[name] = epoch
            for known in (self._came, self._behind, self._passed):
                known.pop(name, None)
        self._epochs[name] = epoch

    def release(self, name: str) -> None:
        """Note that nobody speaks for a name any more, as its token is gone."""
        self._epochs.pop(name, None)

    def epoch(self, name: str) -> int | None:
        """Epoch of who speaks for a name; None if nobody does."""
        return self._epochs.get(name)

    def lives(self, message: AnyMessage) -> bool:
        """Whether a message is of the epoch in which its sender speaks now."""
        return self._epochs.get(message.sender) == message.epoch

    def check(self, message: AnyMessage) -> None:
        """Make sure of that.

        Raises
        ------
        RejectedError
            If it is a ghost's, or nobody of this name is known (yet).
        """
        name = message.sender
        if self._epochs.get(name) == message.epoch:
            return
        what = f"{type(message).__name__}({message.seq}) of epoch {message.epoch} of {name}"
        if name in self._epochs:
            raise RejectedError("ghost", f"{what}, who lives in epoch {self._epochs[name]}")
        if self._numbered.get(name) == message.epoch:
            raise RejectedError("ghost", f"{what}, who is gone")
        raise RejectedError("unexpected", f"{what}, of whom no process is known")

    def take(self, message: AnyMessage) -> int:
        """Take the number of a message that came off the wire; how many between it and the last did not.

        Raises
        ------
        RejectedError
            If a later one has come before.
        """
        name, seq, t = message.sender, message.seq, message.t
        missed = 0
        if name in self._came:
            last, at = self._came[name]
            if seq > last:
                missed = seq - last - 1
            elif self._rises(name, seq):
                self._passed.pop(name, None)
            else:
                raise RejectedError("stale", f"{type(message).__name__}({seq}) of {name} after {last}")
            if missed > AHEAD + self._rate * (t - at):
                missed = 0  # nobody can have sent so many
        self._came[name] = seq, t
        self._behind.pop(name, None)
        return missed

    def _rises(self, name: str, seq: int) -> bool:
        """Whether a sender has been behind its own last number for so long that this number was a lie."""
        last, count = self._behind.get(name, (-1, 0))
        count = count + 1 if seq > last else 1
        self._behind[name] = seq, count
        return count >= PERSISTENT

    def passes(self, message: AnyMessage) -> bool:
        """Whether a message that is here at last is of use: alive, and later than all that were."""
        name = message.sender
        if not self.lives(message) or message.seq <= self._passed.get(name, -1):
            return False
        self._passed[name] = message.seq
        return True
