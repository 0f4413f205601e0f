"""The interface between a node and the emulated links in front of it; `netem` has the real ones. Pure."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence, Set
from typing import Any, NamedTuple, Protocol

from gridpeers.wire.messages import AnyMessage, Measurement, State

REPORT_TICKS = 100  # Ticks between two reports of a receiver on the links into it


class Arrival(NamedTuple):
    """A message that a link has let through."""

    src: str
    payload: bytes
    """Its bytes, with a flipped bit if the link has corrupted it."""
    delay: float
    message: AnyMessage | None = None
    """The message as it was offered; None if the link has corrupted it."""


class CommandEffect(NamedTuple):
    text: str
    """The command in words, in one line; a heal names the links that it heals."""
    receivers: tuple[str, ...]
    """Receivers, in the whole run, of the links that it changes."""
    changed: str
    """The links here that it changes, "" if none."""


class Links(Protocol):
    """All links into one receiver. Times are run time (s), on whichever clock the receiver uses throughout."""

    @property
    def clear(self) -> Set[str]:
        """Senders whose messages `offer` never takes; an attribute, because every message reads it."""

    @property
    def pauses(self) -> Container[float]:
        """Times (s of run time) at which the receiver is paused."""

    @property
    def dropped(self) -> int: ...

    def offer(self, message: State | Measurement, payload: bytes, at: float) -> bool:
        """Take a message off the wire at this time (s); return False if no fault ever acts on its link."""

    def due(self, now: float) -> Sequence[Arrival]:
        """Take out the messages that have arrived by now, in the order of arrival."""

    def command(self, tree: Mapping[str, Any], t: float) -> CommandEffect:
        """Apply a link command to messages sent at t (s of run time) or later; raise ValueError if it is none."""

    def node_events(self, t: float) -> Sequence[tuple[str, str]]:
        """Take out what nodes with faults began or ended by t (s of run time): the agent and a sentence each."""

    def impaired(self, t: float) -> tuple[str, ...]: ...

    def status(self, t: float) -> bytes: ...

    def restart(self) -> None: ...

    def report(self, *, last: bool = False) -> tuple[bytes, ...]:
        """Take out the links' account since the last report, for the record; the last report is never empty."""
