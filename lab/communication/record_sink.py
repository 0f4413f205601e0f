"""Interface between a pass over a record and the checks: states, decisions and arrivals, and totals at the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple, Protocol

from gridpeers.lab.communication.dropped_states import DroppedStates
from gridpeers.netem.ledger import LinkCounts, LinkTrace
from gridpeers.scenarios.record.journal_coverage import INSTANT, Hole
from gridpeers.wire.journal import Decision

Link = tuple[str, str]
"""Sender and receiver."""


class SentState(NamedTuple):
    """A state that an agent sent."""

    number: int
    """Its number."""
    t: float
    """Run time (s)."""
    epoch: int
    """Epoch of its process."""
    idle: bool
    """Whether the agent decided nothing: it was paused, or had no measurement."""
    quiet: bool
    """Whether it was not for the neighbours: its law kept its last state in force."""


class RecordSink(Protocol):
    """Takes what a record has, in the order of its file: of each node as it was, of several within a second or so."""

    def state(self, agent: str, state: SentState) -> None:
        """Take a state that an agent sent; it may come twice."""
        ...

    def decision(self, agent: str, epoch: int, decision: Decision) -> None:
        """Take how an agent decided; in simulated time it holds until the next one."""
        ...

    def heard(self, link: Link, epoch: int, number: int, rejected: str) -> None:
        """Take a state that arrived in wall-clock time, and why it was rejected, if it was."""
        ...

    def dropped(self, link: Link, states: DroppedStates) -> None:
        """Take the number of states that a receiver dropped unread in wall-clock time, or too late to note each."""
        ...

    def renewed(self, agent: str, t: float) -> None:
        """Take that an agent opened a new session in wall-clock time, after its state of a run time (s)."""
        ...

    def counts(self, link: Link, counts: LinkCounts) -> None:
        """Take the account of an emulated link up to now."""
        ...

    def trace(self, trace: LinkTrace) -> None:
        """Take further verdicts of an emulated link."""
        ...

    def known_until(self, agent: str, t: float) -> None:
        """Take the run time (s) up to which it is known how an agent decided, where its journal comes all the time."""
        ...


@dataclass(frozen=True, kw_only=True)
class PassEnd:
    """Totals of a pass over a whole record."""

    unreadable: int
    """Number of messages, entries, reports and parts of the file that could not be read, or cannot be true."""
    lost: Mapping[str, Sequence[Hole]]
    """Simulated time: run times (s) between which parts of a node's journal are lost."""
    known_until: Mapping[str, float]
    """Simulated time: run time (s) behind which no part of a node's journal has come; infinite if none need come."""

    @property
    def holes(self) -> dict[str, Sequence[Hole]]:
        """Run times (s) between which it is not known how an agent decided, or what the plant heard."""
        return {name: [*self.lost[name], (t + INSTANT, inf)] for name, t in self.known_until.items()}
