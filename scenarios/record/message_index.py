"""The messages and journal entries of a record, found by sender and number without reading all of it."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import inf
from typing import TypeVar

from gridpeers.scenarios.record.journal_reader import entries_of, message_of, values_of
from gridpeers.scenarios.record.record_file import RecordFile
from gridpeers.scenarios.record.record_info import Topic
from gridpeers.wire.codec import encode, sound
from gridpeers.wire.journal import (
    Entry,
    Exchange,
    MessageReference,
    ReceivedMessage,
    SentMessage,
    kind_of,
    name_of,
    sender_of,
)
from gridpeers.wire.links import REPORT_TICKS
from gridpeers.wire.messages import AnyMessage, Journal, Measurement, State

M = TypeVar("M", bound=AnyMessage)

LATE = 2.0
"""Longest time (s; of wall time in real time) after which an entry of a journal may come into the record."""


@dataclass(frozen=True, kw_only=True)
class MessageOnWire:
    """A message as it was sent, or as it was heard."""

    sender: str
    receiver: str = ""
    """Name of who heard it; empty for a message as it was sent."""
    kind: str = ""
    """Its type, such as "State"; empty if it has none."""
    key: str
    """Its key, without `gridpeers/<run>/`."""
    epoch: int = -1
    """Epoch of its sender; -1 if it cannot be read."""
    number: int = -1
    """Its number; -1 if it cannot be read."""
    t: float = -1.0
    """Run time that it says (s); -1 if it cannot be read. Of one that was rejected, about when that was."""
    at: float | None = None
    """When it was sent, or heard, on the clock of that process (s, monotonic); None in simulated time."""
    rejected: str = ""
    """Kind of its rejection by the receiver (`gridpeers.wire.codec.KINDS`); empty if it was used, or as it was sent."""
    message: AnyMessage | None = None
    """The message; None if the record does not have it, or no receiver of this version would take it."""
    payload: bytes = b""


@dataclass
class _Part:
    states: dict[tuple[str, int], list[State]] = field(default_factory=lambda: defaultdict(list))
    measurements: dict[tuple[str, int], list[Measurement]] = field(default_factory=lambda: defaultdict(list))
    entries: list[tuple[Journal, Entry]] = field(default_factory=list)
    """All entries, each with the part of the journal that it came in."""


class MessageIndex:
    """Find messages and entries in the file of a record."""

    def __init__(self, file: RecordFile) -> None:
        self.file, self.info = file, file.info
        self.damage: list[str] = []
        """Sentences on what could not be read."""
        wall = self.info.clock == "wall"
        speed = self.info.plant.speed if wall else 0.0
        self._late = LATE * max(1.0, speed) if wall else max(LATE, REPORT_TICKS * self.info.T_c)
        """As `LATE`, of run time: in simulated time reports come every so many ticks."""
        self._reach = max(0.0, 2.0 * speed - 1.0)
        """How much further than its own time a message is looked for (s of run time): journals come up to a second of
        wall time late."""
        self.part = lru_cache(maxsize=40)(self._read_part)  # more than `near` yields for a message: 20 in real time

    @property
    def parts(self) -> int:
        return len(self.file.ends)

    def note_damage(self, text: str) -> None:
        if text not in self.damage:
            self.damage.append(text)

    def of_type(self, topic: Topic, kind: type[M], parts: Iterable[int] | None = None) -> Iterator[M]:
        """Yield the messages of a topic that can be read, of some parts or of all."""
        for index in range(self.parts) if parts is None else parts:
            for record in self.file.part(index):
                if record.topic != topic:
                    continue
                message = sound(record.data)
                if message is None:
                    self.note_damage(f"a message of {topic} at t = {record.t / 1e9:.2f} s cannot be read")
                elif isinstance(message, kind):
                    yield message

    def near(self, since: float, until: float) -> range:
        """Return the parts that may have what happened between two run times (s)."""
        ends = self.file.ends
        last = bisect_left(ends, until + self._late) + 1
        return range(bisect_left(ends, since - 1e-9), min(last, len(ends)))

    def entries_in(self, journal: Journal) -> Iterator[Entry]:
        """Yield the entries of one part of a journal, as far as they can be read."""
        try:
            yield from entries_of(journal.data)
        except ValueError as error:
            self.note_damage(f"the journal of {journal.sender} at t = {journal.t:.2f} s cannot be read: {error}")

    def journals_in(self, part: int) -> Iterator[Journal]:
        return self.of_type("journal", Journal, (part,))

    def entries(self, node: str, since: float = 0.0, until: float = inf) -> Iterator[Entry]:
        for index in self.near(since, until):
            yield from (entry for journal, entry in self.part(index).entries if journal.sender == node)

    def state(self, sender: str, number: int, t: float, epoch: int | None = None) -> State | None:
        """Return a state of about run time t (s); None if the record does not have it.

        Of several that restarted processes numbered alike, it is the one of this epoch, or the nearest in time.
        """
        return _nearest((self.part(i).states.get((sender, number), ()) for i in self._about(t)), t, epoch)

    def measurement(self, to: str, number: int, t: float, epoch: int | None = None) -> Measurement | None:
        """Return a measurement of about run time t (s), as `state` does."""
        return _nearest((self.part(i).measurements.get((to, number), ()) for i in self._about(t)), t, epoch)

    def named_by(self, entry: MessageReference, t: float) -> State | Measurement | None:
        """Return the message of about run time t (s) that an entry names by its number, as `state` does."""
        find = self.measurement if kind_of(entry.key) == "measurement" else self.state
        return find(name_of(entry.key), entry.seq, t, entry.epoch)

    def _about(self, t: float) -> range:
        """Return the parts that may have a message of about run time t (s): a journal is of the last second."""
        return self.near(t - 1.0 - self._reach, t + self._reach)

    def messages(self, sender: str | None, since: float, until: float, kind: str | None) -> Iterator[MessageOnWire]:
        """Yield messages as they were sent; see `RunRecord.messages`."""
        known: dict[tuple[str, int, int], None] = {}
        for index in self.near(since, until):
            for _, entry in self.part(index).entries:
                for key, payload, message, at in self._sent(entry):
                    if not key:
                        continue
                    each = on_wire(key, payload, at, message=message)
                    fits = (sender is None or each.sender == sender) and (kind is None or each.kind == kind)
                    if not fits or not since - 1e-9 <= each.t <= until + 1e-9:
                        continue
                    if each.kind == "State":  # the plant notes it too, while it knows no journal
                        if (one := (each.sender, each.epoch, each.number)) in known:
                            continue
                        known[one] = None
                        if len(known) > 100_000:
                            known.pop(next(iter(known)))
                    yield each

    def _sent(self, entry: Entry) -> Iterator[tuple[str, bytes, AnyMessage | None, float | None]]:
        """Yield key, bytes, message and time (s, monotonic) of each message in an entry, as far as it has them."""
        if isinstance(entry, Exchange):
            kinds = [(Measurement, raw) for raw in entry.measurements] + [(State, raw) for raw in entry.states]
            for kind, raw in kinds:
                message = message_of(raw, kind, self.info)
                key = f"measurement/{message.to}" if isinstance(message, Measurement) else ""
                key = key or (f"state/{message.sender}" if message else "")
                yield key, raw if isinstance(raw, bytes) else b"", message, None
        elif isinstance(entry, SentMessage) or (isinstance(entry, ReceivedMessage) and not entry.rejected):
            at = entry.at if isinstance(entry, SentMessage) else None
            yield entry.key, entry.payload, sound(entry.payload), at

    def _read_part(self, index: int) -> _Part:
        part = _Part()
        for journal in self.journals_in(index):
            for entry in self.entries_in(journal):
                part.entries.append((journal, entry))
                for _, _, message, _ in self._sent(entry):
                    if isinstance(message, State):
                        part.states[message.sender, message.seq].append(message)
                    elif isinstance(message, Measurement):
                        part.measurements[message.to, message.seq].append(message)
                    elif message is None:
                        self.note_damage("a message in a journal cannot be read")
        return part


def _nearest(found: Iterable[Sequence[M]], t: float, epoch: int | None) -> M | None:
    """Return the message of an epoch, or of any, that is nearest in time: numbers begin anew with a process."""
    own = (message for part in found for message in part if epoch is None or message.epoch == epoch)
    return min(own, key=lambda message: abs(message.t - t), default=None)


def on_wire(
    key: str,
    payload: bytes,
    at: float | None,
    *,
    receiver: str = "",
    rejected: str = "",
    message: AnyMessage | None = None,
) -> MessageOnWire:
    """Return a message from its bytes, or from the message itself where none were sent."""
    message = message or sound(payload)
    if message is not None:
        return MessageOnWire(
            sender=message.sender,
            receiver=receiver,
            kind=type(message).__name__,
            key=key,
            epoch=message.epoch,
            number=message.seq,
            t=message.t,
            at=at,
            rejected=rejected,
            message=message,
            payload=payload or encode(message),
        )
    values = values_of(payload)
    epoch, number, t = (values.get(name) for name in ("epoch", "seq", "t"))
    return MessageOnWire(
        sender=str(values.get("sender") or key.rpartition("/")[2])[:64],
        receiver=receiver,
        kind=str(values.get("type") or "")[:40],
        key=key,
        epoch=epoch if type(epoch) is int else -1,
        number=number if type(number) is int else -1,
        t=float(t) if isinstance(t, int | float) else -1.0,
        at=at,
        rejected=rejected,
        payload=payload,
    )


def heard_of(receiver: str, message: AnyMessage | None, entry: MessageReference, t: float) -> MessageOnWire:
    """Return a message as it was heard, whose bytes are in its sender's journal."""
    return replace(
        on_wire(entry.key, b"", entry.at, receiver=receiver, rejected=entry.rejected, message=message),
        sender=sender_of(entry.key),
        kind="Measurement" if kind_of(entry.key) == "measurement" else "State",
        epoch=entry.epoch,
        number=entry.seq,
        t=t if message is None else message.t,
    )
