"""The messages and tokens of a node, noted in its journal as they come and go. Pure."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Protocol

from msgspec.structs import astuple

from gridpeers.wire.codec import sound
from gridpeers.wire.journal import (
    AT_ONCE,
    EACH_TICK,
    Exchange,
    JournalBuffer,
    MessageReference,
    ProcessEvent,
    ReceivedMessage,
    RejectedCount,
    SentMessage,
    Token,
    WakeUp,
    kind_of,
)
from gridpeers.wire.keys import Keys
from gridpeers.wire.messages import Measurement, State

SHOWN_PAYLOAD = 1_000
"""Most bytes that are noted of a message that was rejected."""

_IN_TELEMETRY = ("telemetry", "journal", "report")
"""Kinds of keys whose messages the record has anyway: the plant publishes them for recorders."""

_CONDITION = ("status", "answer")
"""Kinds of keys by which a node says how it does; a status decides what events the plant tells."""

_NOT_NOTED = _IN_TELEMETRY + _CONDITION
"""Kinds of keys whose messages a sender does not note."""


class Traffic(Protocol):
    """Takes all messages and tokens of a node; `at` is the driver's clock (s)."""

    def sent(self, key: str, payload: bytes) -> None: ...
    def received(self, key: str, payload: bytes, at: float, rejected: str) -> None: ...
    def lost(self, key: str, kind: str, count: int, at: float) -> None: ...
    def token(self, key: str, at: float, *, appeared: bool) -> None: ...
    def line(self, text: str) -> None: ...


class TickTraffic:
    """The plant's messages in simulated time: what makes a tick is one entry, all else is noted one by one.

    No time is noted, because none of them counts: so the record is the same from every driver.
    """

    def __init__(self, keys: Keys, names: Collection[str], journal: JournalBuffer) -> None:
        self._journal, self._cut = journal, len(keys.prefix)
        self._of_tick: dict[str, list[Any]] = {}
        """The list of a tick to which messages on a key belong."""
        self._measurements: list[Any] = []
        self._states: list[Any] = []
        for name in names:
            self._of_tick[keys.measurement(name)] = self._measurements
            self._of_tick[keys.state(name)] = self._states
        self._elsewhere = {keys.telemetry, keys.request, *map(keys.report, names), *map(keys.journal, names)}
        """Keys whose messages the record has anyway, or, of recorders, has no use for."""

    def sent(self, key: str, payload: bytes) -> None:
        of_tick = self._of_tick.get(key)
        if of_tick is not None:
            of_tick.append(payload)
        elif key not in self._elsewhere:
            self._journal.add(SentMessage(None, key[self._cut :], payload))

    def received(self, key: str, payload: bytes, at: float, rejected: str) -> None:
        of_tick = self._of_tick.get(key)
        if of_tick is not None and not rejected:
            of_tick.append(payload)
        elif rejected:
            self._journal.add_rejected(ReceivedMessage(None, key[self._cut :], payload[:SHOWN_PAYLOAD], rejected))
        elif key not in self._elsewhere:
            self._journal.add(ReceivedMessage(None, key[self._cut :], payload))

    def lost(self, key: str, kind: str, count: int, at: float) -> None:
        self._journal.count(RejectedCount(None, key[self._cut :], kind, count))

    def token(self, key: str, at: float, *, appeared: bool) -> None:
        self._journal.add(Token(None, key[self._cut :], appeared))

    def line(self, text: str) -> None:
        self._journal.add(ProcessEvent(None, "line", text))

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


class TimedTraffic:
    """The messages and tokens of a node in wall-clock time, each with its time, in the order in which they came.

    What went into the core is noted call by call, so that the core can be given the same again.
    Without `arrivals` only what the node sends is noted. With `whole` states are noted with their bytes, as by the
    plant, which hears all of them: a killed agent takes the end of its own journal with it, and an agent of others
    keeps none.
    """

    def __init__(self, keys: Keys, journal: JournalBuffer, *, arrivals: bool = True, whole: bool = False) -> None:
        self._journal, self._cut, self._arrivals = journal, len(keys.prefix), arrivals
        self._whole = whole
        self.now = 0.0
        """Time of the last call of the node (s, monotonic)."""

    def sent(self, key: str, payload: bytes) -> None:
        name = key[self._cut :]
        if kind_of(name) not in _NOT_NOTED:
            self._journal.add(SentMessage(self.now, name, payload))

    def received(self, key: str, payload: bytes, at: float, rejected: str) -> None:
        self.now = at
        name = key[self._cut :]
        kind = kind_of(name)
        needless = _IN_TELEMETRY if self._arrivals else _NOT_NOTED
        if not (self._arrivals or self._whole) or (kind in needless and not rejected):
            return
        shown = payload[:SHOWN_PAYLOAD] if rejected else payload
        entry: MessageReference | ReceivedMessage = ReceivedMessage(at, name, shown, rejected)
        # its sender has noted it; any other reject may be of somebody who keeps no journal
        noted = kind in EACH_TICK and not self._whole and rejected in ("", "stale")
        if noted and (message := sound(payload)):
            entry = MessageReference(at, name, message.epoch, message.seq, rejected)
        (self._journal.add_rejected if rejected else self._journal.add)(entry)

    def lost(self, key: str, kind: str, count: int, at: float) -> None:
        self.now = at
        if self._arrivals or self._whole:
            self._journal.count(RejectedCount(at, key[self._cut :], kind, count))

    def token(self, key: str, at: float, *, appeared: bool) -> None:
        self.now = at
        if self._arrivals:
            self._journal.add(Token(at, key[self._cut :], appeared))

    def woken(self, at: float, *, work: bool = False) -> None:
        self.now = at
        if self._arrivals:
            self._journal.add(WakeUp(at, work))

    def process(self, kind: str, text: str, at: float) -> None:
        self.now = at
        self._journal.add(ProcessEvent(at, kind, text))

    def line(self, text: str) -> None:
        self._journal.add(ProcessEvent(self.now, "line", text))
