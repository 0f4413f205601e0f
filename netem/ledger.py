"""The verdicts on the messages of one link, with their counts, which close, and their hash."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from hashlib import sha256

import msgspec

from gridpeers.netem.channel import DROPPED
from gridpeers.wire.messages import Count, Label, Name, Time

Outcome = float | str | tuple[tuple[float, Count | None], ...]
"""Delay (s) of one sound copy; or why it was dropped; or delay and flipped bit of each copy."""


class LinkTrace(msgspec.Struct, frozen=True, array_like=True):
    """Verdicts on the messages of one link, in their order.

    A message that was judged anew, because the cut that kept it was healed early, has a second row, which counts.
    """

    src: Name
    """Sender."""
    dst: Name
    """Receiver."""
    seq: tuple[Count, ...]
    """Numbers of the messages."""
    t: tuple[Time, ...]
    """When each was sent (s of run time)."""
    outcome: tuple[Outcome, ...]
    """Outcome of each."""

    def __post_init__(self) -> None:
        if not len(self.seq) == len(self.t) == len(self.outcome):
            raise ValueError(f"{len(self.seq)} numbers, {len(self.t)} times, {len(self.outcome)} outcomes")
        # not by the type: msgspec 0.22 corrupts memory over a union of a text with a pattern, a number and a tuple
        if not {outcome for outcome in self.outcome if isinstance(outcome, str)} <= DROPPED.keys():
            raise ValueError("a message was dropped for no reason that there is")


def copies_of(outcome: Outcome) -> tuple[tuple[float, Count | None], ...]:
    """Return delay (s) and flipped bit of each copy of a message; none if it was dropped.

    Examples
    --------
    >>> copies_of(0.01), copies_of("loss"), copies_of(((0.01, None), (0.02, 7)))
    (((0.01, None),), (), ((0.01, None), (0.02, 7)))
    """
    if isinstance(outcome, str):
        return ()
    return ((float(outcome), None),) if isinstance(outcome, int | float) else outcome


class LinkCounts(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Counts of the messages of one link: sent + duplicated = delivered + dropped + in_flight."""

    sent: Count
    """Messages that were judged here."""
    duplicated: Count
    """Copies made of them."""
    delivered: Count
    """Handed to the receiver, copies included."""
    dropped: dict[Label, Count]
    """Not delivered, by reason."""
    corrupted: Count
    """Arrived with a flipped bit; delivered, or dropped by "checksum"."""
    in_flight: Count
    """Not arrived yet."""
    lies: Count = 0
    """States among those sent that say something else here than their sender has decided."""

    @property
    def closes(self) -> bool:
        """Whether every message is accounted for."""
        return self.sent + self.duplicated == self.delivered + sum(self.dropped.values()) + self.in_flight


class Ledger:
    """The verdicts and counts of one link; without `keep` only the hash of the verdicts is kept."""

    __slots__ = ("_keep", "_kept", "_sha", "corrupted", "delivered", "dropped", "duplicated", "new", "sent")

    def __init__(self, *, keep: bool) -> None:
        self.sent = self.duplicated = self.delivered = self.corrupted = 0
        self.dropped: Counter[str] = Counter()
        self._keep = keep
        self.new: list[tuple[int, float, Outcome]] = []
        """The latest verdicts; whoever appends one calls `fold` at `BATCH` of them."""
        self._kept: list[tuple[int, float, Outcome]] = []
        self._sha = sha256()

    def counts(self, in_flight: int) -> LinkCounts:
        """Return the counts; the caller has counted the messages in flight."""
        return LinkCounts(
            sent=self.sent,
            duplicated=self.duplicated,
            delivered=self.delivered,
            dropped=dict(self.dropped),
            corrupted=self.corrupted,
            in_flight=in_flight,
        )

    def take(self, src: str, dst: str) -> LinkTrace | None:
        """Return the verdicts since the last call, None if there are none."""
        self.fold()
        rows, self._kept = self._kept, []
        if not rows:
            return None
        seq, t, outcome = zip(*rows, strict=True)
        return LinkTrace(src, dst, seq, t, outcome)

    def digest(self) -> bytes:
        """Return the hash of all verdicts so far; empty if there are none."""
        self.fold()
        return self._sha.digest() if self._sha.digest() != _NOTHING else b""

    def fold(self) -> None:
        """Hash the new verdicts row by row, so that the times of these calls do not matter."""
        self._sha.update(b"".join(map(_encode, self.new)))
        if self._keep:
            self._kept += self.new
        self.new.clear()


def combined(digests: Mapping[str, str] | Iterable[tuple[str, str]]) -> str:
    """Return one hash (hex) of the hashes of a run's receivers, by their names, in any order.

    Examples
    --------
    >>> combined({"inv1": "00", "inv2": "ff"}) == combined([("inv2", "ff"), ("inv1", "00")])
    True
    """
    return sha256(_encode(sorted(dict(digests).items()))).hexdigest()


BATCH = 512  # Verdicts that are hashed at once

_NOTHING = sha256().digest()
_encode = msgspec.msgpack.Encoder().encode
