"""The messages and journal entries of a record, found by sender and number without reading all of it."""

from __future__ import annotations

from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf
from typing import TypeVar

from gridpeers.scenarios.record.journal_reader import entries_of, message_of
from gridpeers.scenarios.record.record_file import RecordFile
from gridpeers.scenarios.record.record_info import Topic
from gridpeers.wire.codec import sound
from gridpeers.wire.journal import (
    Decision,
    Entry,
    Exchange,
    MessageReference,
    ReceivedMessage,
    SentMessage,
    kind_of,
    name_of,
)
from gridpeers.wire.links import REPORT_TICKS
from gridpeers.wire.messages import AnyMessage, Journal, Measurement, Message, State

M = TypeVar("M", bound=Message)

LATE = 2.0  # Longest time (s; of real time in real time) after which an entry of a journal may come into the record
MOST_KNOWN = 100_000  # States that are known as noted: by their sender, and by a plant while it knows no journal


@dataclass
class RecordPart:
    entries: list[tuple[Journal, Entry]] = field(default_factory=list)
    """All entries, each with the part of the journal that it came in."""
    messages: list[AnyMessage] = field(default_factory=list)
    """Messages as they were sent, in the order of the entries."""
    states: dict[tuple[str, int], list[State]] = field(default_factory=lambda: defaultdict(list))
    """By sender and number."""
    measurements: dict[tuple[str, int], list[Measurement]] = field(default_factory=lambda: defaultdict(list))
    """By receiver and number."""
    decisions: dict[str, dict[int, Decision]] = field(default_factory=lambda: defaultdict(dict))
    """By agent and number of the state that came out."""


class MessageIndex:
    def __init__(self, file: RecordFile) -> None:
        self.file, self.info = file, file.info
        self.damage: list[str] = []
        """Sentences on what could not be read."""
        realtime = self.info.clock == "realtime"
        speed = self.info.plant.speed if realtime else 0.0
        self._late = LATE * max(1.0, speed) if realtime else max(LATE, REPORT_TICKS * self.info.T_c)
        """As `LATE`, of run time: in simulated time reports come every so many ticks."""
        self._reach = max(0.0, 2.0 * speed - 1.0)
        """How much further than its own time a message is looked for (s of run time): journals come up to a second of
        real time late."""
        self.part = lru_cache(maxsize=40)(self._read_part)  # more than `near` yields for a message: 20 in real time

    @property
    def parts(self) -> int:
        return len(self.file.ends)

    def note_damage(self, text: str) -> None:
        if text not in self.damage:
            self.damage.append(text)

    def of_type(self, topic: Topic, kind: type[M], parts: Iterable[int] | None = None) -> Iterator[M]:
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

    def journals_in(self, part: int) -> Iterator[Journal]:
        return self.of_type("journal", Journal, (part,))

    def entries_in(self, journal: Journal) -> Iterator[Entry]:
        where = f"the journal of {journal.sender} at t = {journal.t:.2f} s cannot be read"
        return entries_of(journal.data, lambda error: self.note_damage(f"{where}: {error}"))

    def entries(self, node: str, since: float = 0.0, until: float = inf) -> Iterator[Entry]:
        for index in self.near(since, until):
            yield from (entry for journal, entry in self.part(index).entries if journal.sender == node)

    def state(self, sender: str, number: int, t: float, epoch: int | None = None) -> State | None:
        """Return a state of about run time t (s); None if the record does not have it.

        Of several that restarted processes numbered alike, it is the one of this epoch, or the nearest in time.
        """
        return _nearest((self.part(i).states.get((sender, number), ()) for i in self._about(t)), t, epoch)

    def measurement(self, to: str, number: int, t: float, epoch: int | None = None) -> Measurement | None:
        return _nearest((self.part(i).measurements.get((to, number), ()) for i in self._about(t)), t, epoch)

    def named_by(self, entry: MessageReference, t: float) -> State | Measurement | None:
        """Return the message of about run time t (s) that an entry names by its number, as `state` does."""
        find = self.measurement if kind_of(entry.key) == "measurement" else self.state
        return find(name_of(entry.key), entry.seq, t, entry.epoch)

    def _about(self, t: float) -> range:
        """Return the parts that may have a message of about run time t (s): a journal is of the last second."""
        return self.near(t - 1.0 - self._reach, t + self._reach)

    def messages(self, kind: type[M], sender: str | None, since: float, until: float) -> Iterator[M]:
        known: dict[tuple[str, int, int], None] = {}
        for index in self.near(since, until):
            for each in self.part(index).messages:
                if not isinstance(each, kind) or (sender or each.sender) != each.sender:
                    continue
                if not since - 1e-9 <= each.t <= until + 1e-9:
                    continue
                if isinstance(each, State):
                    if (one := (each.sender, each.epoch, each.seq)) in known:
                        continue
                    known[one] = None
                    if len(known) > MOST_KNOWN:
                        known.pop(next(iter(known)))
                yield each

    def _read_part(self, index: int) -> RecordPart:
        part = RecordPart()
        for journal in self.journals_in(index):
            for entry in self.entries_in(journal):
                part.entries.append((journal, entry))
                if isinstance(entry, Decision):
                    part.decisions[journal.sender][entry.tick] = entry
                for message in self._sent(entry):
                    if message is None:
                        self.note_damage("a message in a journal cannot be read")
                        continue
                    part.messages.append(message)
                    if isinstance(message, State):
                        part.states[message.sender, message.seq].append(message)
                    elif isinstance(message, Measurement):
                        part.measurements[message.to, message.seq].append(message)
        return part

    def _sent(self, entry: Entry) -> Iterator[AnyMessage | None]:
        """Yield each message whose bytes are in an entry; None for one that cannot be read."""
        match entry:
            case Exchange(measurements=measurements, states=states):
                yield from (message_of(raw, Measurement, self.info) for raw in measurements)
                yield from (message_of(raw, State, self.info) for raw in states)
            case SentMessage(payload=payload) | ReceivedMessage(payload=payload, rejected=""):
                yield sound(payload)


def _nearest(found: Iterable[Sequence[M]], t: float, epoch: int | None) -> M | None:
    """Return the message of an epoch, or of any, that is nearest in time: numbers begin anew with a process."""
    own = (message for part in found for message in part if epoch is None or message.epoch == epoch)
    return min(own, key=lambda message: abs(message.t - t), default=None)
