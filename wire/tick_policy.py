"""When a node ticks: the interface of the two policies, a barrier in simulated time and a timer in real time. Pure."""

from __future__ import annotations

from typing import Literal, NamedTuple, Protocol

from gridpeers.wire.messages import State
from gridpeers.wire.timing import Awaited


class TickVerdict(NamedTuple):
    """Consequence of a passed deadline."""

    kind: Literal["wait", "over", "tick", "break"]
    """Continue to wait; end the wait; do the due tick; or break the run, or leave it."""
    reason: str = ""
    """Why the run breaks, with the messages that are missing."""
    warnings: tuple[str, ...] = ()


WAIT = TickVerdict("wait")


class TickPolicy(Protocol):
    """Decide when a node ticks, from which messages; the node decides all else. Times are s on the driver's clock."""

    @property
    def grants(self) -> bool:
        """Whether each measurement grants a tick, as in simulated time: no clock decides."""

    @property
    def messages_needed(self) -> int:
        """Number of messages that are needed before the deadline."""

    @property
    def deadline(self) -> float | None:
        """Time of the next call of `passed`."""

    def start(self, now: float) -> None: ...

    def run_time(self, t: float, now: float) -> float:
        """Return the run time (s) of an action that belongs to t: t itself, or the present time of the own clock."""

    def due(self, now: float) -> int | None:
        """Return the tick to do now, None if there is none."""

    def counts(self, state: State, now: float) -> bool:
        """Take a received state; return whether it enters the present tick. RejectedError if a later one came."""

    def missing(self) -> tuple[Awaited, ...]:
        """Return the messages without which the tick is not due, and their senders."""

    def passed(self, now: float, unmet: tuple[Awaited, ...] = ()) -> TickVerdict:
        """Judge a deadline that may have passed; `unmet`: tokens and nameplates that the node waits for."""
