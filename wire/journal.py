"""A node's journal: what went into its core and what came out, as a stream of entries, for a recorder. Pure.

A node notes the bytes that it sends, what it hears, tokens that come and go, and the inputs of each decision: the same
cores compute everything else again. An entry is a msgpack array whose first value names its kind; entries follow each
other without a frame, so a journal may be cut at any of them. `gridpeers.wire.messages.Journal` carries one part.

Three rules keep it small, because in simulated time a tick must not wait for its journal:

- A message is noted with its bytes by its sender, and each state by the plant too, should its agent be killed before it
  has sent its journal. Any other that hears it notes sender, epoch and number.
- In simulated time the plant notes all measurements and states of a tick in one entry, because they all pass it. An
  agent has heard all states of the tick before from its in-neighbours, unless an emulated link is between.
- In simulated time an agent notes how it decided only where that changes: `Decision` holds until the next one.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Literal

import msgspec
from msgspec.structs import astuple, replace

from gridpeers.wire.codec import sound
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import PLANT, Count, Measurement, State

RecordLevel = Literal["all", "decisions", "physics"]
"""What nodes note: everything; decisions with their inputs, but no arrivals and no fates on links; or nothing, as the
plant's telemetry has the physics."""

LOT = 32_000  # Bytes of entries from which on a part of a journal is sent: Zenoh sends so many in one piece
ROOM = 1_000_000  # Bytes that a journal holds at most: what comes beyond, as in a flood of messages, is counted only

NOTED_REJECTED = 200
"""Rejected messages that are noted between two times at which a journal is taken; the others are counted only."""

AT_ONCE = 64  # Most messages in one entry: of the longest there are, they fit into a part


class Entry(msgspec.Struct, frozen=True, array_like=True):
    """One entry; its tag is the first value of the array."""


class KeyEntry(Entry, frozen=True, array_like=True):
    at: float | None
    """Time on the own clock (s, monotonic), of a message its arrival; None in simulated time."""
    key: str
    """Key, without `gridpeers/<run>/`."""


class Exchange(Entry, frozen=True, array_like=True, tag="exchange"):
    """Measurements that the plant sent and states that it heard in one tick of simulated time, as bytes."""

    tick: int
    measurements: list[Any]
    """Payloads of `Measurement`, in the order in which they were sent. Where plant and agents share a process and send
    none: the values of each in the order of the fields, which the record names."""
    states: list[Any]
    """The same of `State`, in the order in which they came."""


class SentMessage(KeyEntry, frozen=True, array_like=True, tag="sent"):
    """A message that the node sent."""

    payload: bytes


class MessageReference(KeyEntry, frozen=True, array_like=True, tag="heard"):
    """A sound message off the wire whose bytes are in its sender's journal."""

    epoch: int
    seq: int
    rejected: str = ""
    """Kind of its rejection (`gridpeers.wire.codec.KINDS`); empty if it was used."""


class ReceivedMessage(KeyEntry, frozen=True, array_like=True, tag="received"):
    """A message off the wire, with its bytes: nobody else has noted them, or they are not sound."""

    payload: bytes
    rejected: str = ""
    """Kind of its rejection (`gridpeers.wire.codec.KINDS`); empty if it was used."""


class RejectedCount(KeyEntry, frozen=True, array_like=True, tag="rejected"):
    """Messages or tokens on one key of which nothing else is noted: dropped unread, or more rejected than are noted."""

    kind: str
    """Kind of their rejection (`gridpeers.wire.codec.KINDS`)."""
    count: Count


class Token(KeyEntry, frozen=True, array_like=True, tag="token"):
    """A liveliness token that appeared or vanished."""

    appeared: bool


class WakeUp(Entry, frozen=True, array_like=True, tag="woken"):
    """The node acted because its clock said so, after all entries before this one and before those that follow."""

    at: float
    work: bool = False
    """Whether it did its piece of work (`Node.work`: the plant advances), not what was due (`Node.expire`)."""


class ProcessEvent(Entry, frozen=True, array_like=True, tag="process"):
    """An event of the process: its start, a new session, a request from outside to leave, a line of its log."""

    at: float | None
    """Time on the own clock (s, monotonic); None in simulated time."""
    kind: str
    """"start" and "session" (a new one), each with the instance of the process last in its text; "leave" (asked for
    from outside); "line" (of its log); "lost" (entries, as the journal was full)."""
    text: str
    """One sentence."""


class Decision(Entry, frozen=True, array_like=True, tag="decision"):
    """How an agent decided at a tick; in simulated time also at the following ones, until the next entry.

    The lists run over the in-neighbours of the tick, in the order of the roster.
    """

    tick: int
    """Number of the own state that came out."""
    measurement: int
    """In simulated time the age of the own measurement in ticks, 0 without an emulated link; in real time its
    number."""
    neighbours: list[str]
    """In-neighbours by the graph, among those on the roster."""
    states: list[int | None]
    """Last state that was heard of each: in simulated time its age in ticks, 1 without an emulated link; in real
    time its number. None if no state was heard."""
    unused: list[str]
    """Reason why the state of each was left out of the sums: "silent" (none was heard), "stale" (older than
    max_age), "island" (it was in another island), empty if it was used; no list if all were used."""
    weights: list[float]
    """Weight of each, from 0 to 1; no list if all used ones have 1."""
    saturated: tuple[int, int] = (0, 0)
    """Saturated sides of P and V; see `gridpeers.agents.laws.law.Own`."""
    at: float | None = None
    """Time of the decision on the own clock (s, monotonic); None in simulated time."""
    ages: list[float | None] = []
    """Age of each state (s of run time); no list in simulated time, where it is the time between the two ticks."""
    before: list[float] = []
    """Set-points (W, V) before the decision. No list in simulated time, where they are those of the state before, and
    where the agent starts, or starts again after a pause, from those of its measurement."""


AnyEntry = (
    Exchange
    | SentMessage
    | MessageReference
    | ReceivedMessage
    | RejectedCount
    | Token
    | WakeUp
    | ProcessEvent
    | Decision
)

_encode_into = msgspec.msgpack.Encoder().encode_into


class JournalBuffer:
    def __init__(self) -> None:
        self._bytes = bytearray()
        self._lost = 0
        self._ends: list[int] = []
        self._rejected = 0
        self._counts: dict[tuple[str, str], RejectedCount] = {}

    def __len__(self) -> int:
        return len(self._bytes)

    def add(self, entry: Entry) -> None:
        if len(self._bytes) > ROOM:
            self._lost += 1
        else:
            self._append(entry)

    def _append(self, entry: Entry) -> None:
        _encode_into(entry, self._bytes, -1)
        if len(self._bytes) - (self._ends[-1] if self._ends else 0) >= LOT:
            self._ends.append(len(self._bytes))

    def add_rejected(self, entry: ReceivedMessage | MessageReference) -> None:
        """Add an entry about a rejected message, or count it if there are many: floods must not fill the record."""
        self._rejected += 1
        if self._rejected <= NOTED_REJECTED:
            self.add(entry)
        else:
            self.count(RejectedCount(entry.at, entry.key, entry.rejected, 1))

    def count(self, rejected: RejectedCount) -> None:
        """Add to the entry about one key and kind; these come after all others, whatever room there is."""
        before = self._counts.get((rejected.key, rejected.kind))
        number = rejected.count + (0 if before is None else before.count)
        self._counts[rejected.key, rejected.kind] = replace(rejected, count=number)

    def take_parts(self) -> list[bytes]:
        for rejected in self._counts.values():
            self._append(rejected)
        self._counts.clear()
        self._rejected = 0
        if self._lost:
            self._append(ProcessEvent(None, "lost", f"{self._lost} entries: more than {ROOM} bytes"))
            self._lost = 0
        parts, begin = [], 0
        for end in (*self._ends, len(self._bytes)):
            if end > begin:
                parts.append(bytes(self._bytes[begin:end]))
            begin = end
        self._bytes.clear()
        self._ends.clear()
        return parts


EACH_TICK = ("measurement", "state", "set_points")  # Kinds of keys with a message a tick
TO_LINKS = ("link_request", "command")  # Kinds of keys on which commands to emulated links come, among others


def kind_of(key: str) -> str:
    return key.partition("/")[0]


def name_of(key: str) -> str:
    return key.partition("/")[2]


def sender_of(key: str) -> str:
    return PLANT if kind_of(key) == "measurement" else name_of(key)


def stream_of(key: str) -> str:
    """Return the stream to which measurements or states on a key belong: all states of an agent are one."""
    kind, _, name = key.partition("/")
    return f"{'measurement' if kind == 'measurement' else 'state'}/{name}"


SHOWN_PAYLOAD = 1_000  # Most bytes that are noted of a message that was rejected

_IN_TELEMETRY = ("telemetry", "journal", "report")
"""Kinds of keys whose messages the record has anyway: the plant publishes them for recorders."""

_NOT_NOTED = (*_IN_TELEMETRY, "status", "answer")
"""Kinds of keys whose messages a sender does not note: also those by which it says how it does. What the plant hears of
a status is noted, because it decides what events the plant tells."""


class Traffic:
    """Notes all messages and tokens of a node, each with its time, in the order in which they came.

    What went into the core is noted call by call, so that the core can be given the same again.
    Without `arrivals` only what the node sends is noted. With `whole` states are noted with their bytes, as by the
    plant, which hears all of them: a killed agent takes the end of its own journal with it, and an agent of others
    keeps none. In simulated time no time is noted, because none counts: so the record is the same from every driver.
    """

    def __init__(
        self, keys: Keys, journal: JournalBuffer, *, arrivals: bool = True, whole: bool = False, timed: bool = True
    ) -> None:
        self._journal, self._cut, self._timed = journal, len(keys.prefix), timed
        self._arrivals, self._hears = arrivals, arrivals or whole
        self._whole = whole
        self.now = 0.0 if timed else None
        """Time of the last call of the node (s, monotonic)."""

    def sent(self, key: str, payload: bytes) -> None:
        name = key[self._cut :]
        if kind_of(name) not in _NOT_NOTED:
            self._journal.add(SentMessage(self.now, name, payload))

    def received(self, key: str, payload: bytes, at: float, rejected: str) -> None:
        """Note a message; `rejected` is the kind of its rejection, empty if it was used."""
        self._go_on(at)
        name = key[self._cut :]
        kind = kind_of(name)
        needless = _IN_TELEMETRY if self._arrivals else _NOT_NOTED
        if not self._hears or (kind in needless and not rejected):
            return
        shown = payload[:SHOWN_PAYLOAD] if rejected else payload
        entry: MessageReference | ReceivedMessage = ReceivedMessage(self.now, name, shown, rejected)
        # its sender has noted it; any other reject may be of somebody who keeps no journal
        noted = kind in EACH_TICK and not self._whole and rejected in ("", "stale")
        if noted and (message := sound(payload)):
            entry = MessageReference(self.now, name, message.epoch, message.seq, rejected)
        (self._journal.add_rejected if rejected else self._journal.add)(entry)

    def lost(self, key: str, kind: str, count: int, at: float) -> None:
        self._go_on(at)
        if self._hears:
            self._journal.count(RejectedCount(self.now, key[self._cut :], kind, count))

    def token(self, key: str, at: float, *, appeared: bool) -> None:
        self._go_on(at)
        if self._arrivals:
            self._journal.add(Token(self.now, key[self._cut :], appeared))

    def woken(self, at: float, *, work: bool = False) -> None:
        self._go_on(at)
        if self._arrivals:
            self._journal.add(WakeUp(at, work))

    def process(self, kind: str, text: str, at: float | None = None) -> None:
        """Note an event of the process, at the time of the last call if there is no time."""
        if at is not None:
            self._go_on(at)
        self._journal.add(ProcessEvent(self.now, kind, text))

    def _go_on(self, at: float) -> None:
        if self._timed:
            self.now = at


class TickTraffic(Traffic):
    """The plant's messages in simulated time: what makes a tick is one entry, all else is noted one by one."""

    def __init__(self, keys: Keys, names: Collection[str], journal: JournalBuffer) -> None:
        super().__init__(keys, journal, whole=True, timed=False)
        self._measurements: list[Any] = []
        self._states: list[Any] = []
        self._of_tick = {keys.measurement(name): self._measurements for name in names}
        self._of_tick |= {keys.state(name): self._states for name in names}
        """The list of a tick to which messages on a key belong."""
        self._questions = keys.request
        """Key of recorders' questions: how many come is a matter of the machine."""

    def sent(self, key: str, payload: bytes) -> None:
        of_tick = self._of_tick.get(key)
        if of_tick is None:
            super().sent(key, payload)
        else:
            of_tick.append(payload)

    def received(self, key: str, payload: bytes, at: float, rejected: str) -> None:
        of_tick = self._of_tick.get(key)
        if rejected or (of_tick is None and key != self._questions):
            super().received(key, payload, at, rejected)
        elif of_tick is not None:
            of_tick.append(payload)

    def exchanged(self, tick: int, measurements: Sequence[Measurement], states: Sequence[State]) -> None:
        """Note a tick in which plant and agents share a process, and send nothing."""
        self._add_exchange(tick, list(map(astuple, measurements)), list(map(astuple, states)))

    def ticked(self, tick: int) -> None:
        self._add_exchange(tick, self._measurements, self._states)
        self._measurements.clear()
        self._states.clear()

    def _add_exchange(self, tick: int, measurements: list[Any], states: list[Any]) -> None:
        for i in range(0, max(len(measurements), len(states)), AT_ONCE):
            self._journal.add(Exchange(tick, measurements[i : i + AT_ONCE], states[i : i + AT_ONCE]))
