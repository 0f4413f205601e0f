"""Admit or reject messages by the epoch and the number of their sender. Pure.

Both sides check every message, in both kinds of time: as it comes off the wire and, if an emulated link held it, again
when the link delivers it.

- A *name* is valid under its own keys only.
- An *epoch* (`epoch` in messages) identifies one process. The plant's token contains it; an agent's nameplate, asked
  of the one process that holds the token, contains it. It is learnt once. A message of any other epoch is a ghost's.
  Epochs are compared only for equality, so no host's clock decides which process is believed.
- *Numbers* rise within an epoch. One number far ahead would mute its sender for good, so a sender that continues behind
  it is believed again after a while.

This is no protection against an attacker who listens and then sends under another's name, in its epoch and with its
next number: that needs certificates (docs/security.md).
"""

from __future__ import annotations

from math import inf

from gridpeers.wire.codec import RejectedError
from gridpeers.wire.messages import AnyMessage

AHEAD = 50
"""Numbers by which a sender may be ahead of its run time, because it may send several at once."""

FASTER = 2.0
"""Highest plausible rate of a sender in wall-clock time, as a multiple of the receiver's own."""

PERSISTENT = 50
"""Rising messages in a row after which a sender is believed against a higher number: a second at 20 ms."""


class Admission:
    """The valid epoch of each name, and the last numbers of its messages.

    Parameters
    ----------
    rate : float, optional
        Most messages of one sender per s of run time: a larger gap in the numbers is not counted as lost. In simulated
        time numbers are ticks, and each is awaited.

    Examples
    --------
    >>> from gridpeers.wire.messages import Ready
    >>> admission, ready = Admission(), Ready(sender="inv1", epoch=7, seq=0, t=0.0)
    >>> admission.bind("inv1", 7)
    >>> admission.check(ready)
    >>> admission.bind("inv1", 3)
    >>> admission.check(ready)
    Traceback (most recent call last):
        ...
    gridpeers.wire.codec.RejectedError: Ready(0) of epoch 7 of inv1, whose epoch is 3
    """

    def __init__(self, rate: float = inf) -> None:
        self._rate = rate
        self.epochs: dict[str, int] = {}
        """Valid epoch of each name."""
        self._numbered: dict[str, int] = {}
        """Epoch of the numbers below; it outlasts a token that vanishes and reappears."""
        self._arrived: dict[str, tuple[int, float]] = {}
        """Number and run time (s) of the last message off the wire."""
        self._behind: dict[str, tuple[int, int]] = {}
        """Number of the last message that arrived after a later one, and the count of such messages in a row."""
        self._passed: dict[str, int] = {}
        """Number of the last usable message."""

    def bind(self, name: str, epoch: int) -> None:
        """Set the valid epoch of a name; in a new one the numbers start anew."""
        if self._numbered.get(name) != epoch:
            self._numbered[name] = epoch
            for numbers in (self._arrived, self._behind, self._passed):
                numbers.pop(name, None)
        self.epochs[name] = epoch

    def release(self, name: str) -> None:
        """Note that a name has no valid epoch any more, because its token is gone."""
        self.epochs.pop(name, None)

    def epoch(self, name: str) -> int | None:
        """Return the valid epoch of a name; None if there is none."""
        return self.epochs.get(name)

    def lives(self, message: AnyMessage) -> bool:
        """Whether a message has the valid epoch of its sender."""
        return self.epochs.get(message.sender) == message.epoch

    def check(self, message: AnyMessage) -> None:
        """Raise RejectedError if a message is a ghost's, or its sender's epoch is not known (yet)."""
        name = message.sender
        if self.epochs.get(name) == message.epoch:
            return
        what = f"{type(message).__name__}({message.seq}) of epoch {message.epoch} of {name}"
        if name in self.epochs:
            raise RejectedError("ghost", f"{what}, whose epoch is {self.epochs[name]}")
        if self._numbered.get(name) == message.epoch:
            raise RejectedError("ghost", f"{what}, which is gone")
        raise RejectedError("unexpected", f"{what}, of which no process is known")

    def take(self, message: AnyMessage) -> int:
        """Note the number of a message off the wire; return how many are missing between it and the last.

        Raises
        ------
        RejectedError
            If a later message has arrived before.
        """
        name, seq, t = message.sender, message.seq, message.t
        missed = 0
        if name in self._arrived:
            last, at = self._arrived[name]
            if seq > last:
                missed = seq - last - 1
            elif self._rises(name, seq):
                self._passed.pop(name, None)
            else:
                raise RejectedError("stale", f"{type(message).__name__}({seq}) of {name} after {last}")
            if missed > AHEAD + self._rate * (t - at):
                missed = 0  # no sender can have sent so many
        self._arrived[name] = seq, t
        self._behind.pop(name, None)
        return missed

    def _rises(self, name: str, seq: int) -> bool:
        """Whether a sender has been behind its own last number for so long that this number must be wrong."""
        last, count = self._behind.get(name, (-1, 0))
        count = count + 1 if seq > last else 1
        self._behind[name] = seq, count
        return count >= PERSISTENT

    def passes(self, message: AnyMessage) -> bool:
        """Whether a delivered message is usable: of the valid epoch, and later than all usable ones before."""
        name, seq = message.sender, message.seq
        if self.epochs.get(name) != message.epoch or seq <= self._passed.get(name, -1):
            return False
        self._passed[name] = seq
        return True
