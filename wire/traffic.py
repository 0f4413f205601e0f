"""The messages and tokens of a node, noted in its journal as they come and go. Pure."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, Protocol

from msgspec.structs import astuple

from wire.journal import AT_ONCE, Exchange, JournalBuffer, Received, Sent, Token
from wire.keys import Keys
from wire.messages import Measurement, State

SHOWN = 4_000
"""Most bytes that are noted of a message that was rejected."""


class Traffic(Protocol):
    """Takes all messages and tokens of a node; `at` is the driver's clock (s)."""

    def sent(self, key: str, payload: bytes) -> None:
        """Note a message that the node sends."""
        ...

    def received(self, key: str, payload: bytes, at: float, rejected: str) -> None:
        """Note a message off the wire, and the kind of its rejection, if it was rejected."""
        ...

    def token(self, key: str, at: float, *, appeared: bool) -> None:
        """Note a liveliness token that appeared or vanished."""
        ...


class TickTraffic:
    """The plant's messages in simulated time: what makes a tick is one entry, all else is noted one by one.

    No time is noted, because none of them counts: so the record is the same from every driver.

    Parameters
    ----------
    keys : Keys
        Keys of the run.
    names : Collection[str]
        Names of all agents that may take part.
    journal : JournalBuffer
        Takes the entries.
    """

    def __init__(self, keys: Keys, names: Collection[str], journal: JournalBuffer) -> None:
        self._journal, self._cut = journal, len(keys.telemetry) - len("telemetry")
        self._of_tick: dict[str, list[Any]] = {}
        """The list of a tick to which messages on a key belong."""
        self._measurements: list[Any] = []
        self._states: list[Any] = []
        for name in names:
            self._of_tick[keys.measurement(name)] = self._measurements
            self._of_tick[keys.state(name)] = self._states
        self._elsewhere = {keys.telemetry, *map(keys.report, names), *map(keys.journal, names)}
        """Keys whose messages the record has anyway."""

    def sent(self, key: str, payload: bytes) -> None:
        """Note a message that the node sends."""
        of_tick = self._of_tick.get(key)
        if of_tick is not None:
            of_tick.append(payload)
        elif key not in self._elsewhere:
            self._journal.add(Sent(None, key[self._cut :], payload))

    def received(self, key: str, payload: bytes, at: float, rejected: str) -> None:
        """Note a message off the wire, and the kind of its rejection, if it was rejected."""
        of_tick = self._of_tick.get(key)
        if of_tick is not None and not rejected:
            of_tick.append(payload)
        elif rejected or key not in self._elsewhere:
            self._journal.add(Received(None, key[self._cut :], payload[:SHOWN] if rejected else payload, rejected))

    def token(self, key: str, at: float, *, appeared: bool) -> None:
        """Note a liveliness token that appeared or vanished."""
        self._journal.add(Token(None, key[self._cut :], appeared))

    def measured(self, measurements: Sequence[Measurement]) -> None:
        """Note the measurements of a tick where none is sent, as plant and agents share a process."""
        self._measurements += map(astuple, measurements)

    def decided(self, states: Sequence[State]) -> None:
        """Note the states of such a tick."""
        self._states += map(astuple, states)

    def ticked(self, tick: int) -> None:
        """Note that tick k is complete, or that it ends as it is."""
        measurements, states = self._measurements, self._states
        if not (measurements or states):
            return
        if len(measurements) <= AT_ONCE:
            self._journal.add(Exchange(tick, measurements, states))
        else:
            for i in range(0, max(len(measurements), len(states)), AT_ONCE):
                self._journal.add(Exchange(tick, measurements[i : i + AT_ONCE], states[i : i + AT_ONCE]))
        measurements.clear()
        states.clear()
