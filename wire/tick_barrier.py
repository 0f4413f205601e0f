"""The tick policy of simulated time: go on when all that a tick needs is here, or say who is missing. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Awaited(NamedTuple):
    """One message that is waited for."""

    what: str
    """E.g. "State(41)"."""
    who: str
    """Who should send it."""


class TickBarrier:
    """What is awaited of whom, until when, and the last sign of life of everybody.

    Parameters
    ----------
    who : str
        Who waits.
    timeout : float
        Longest wait without progress (s on the driver's clock).

    Examples
    --------
    >>> barrier = TickBarrier("plant", 10.0)
    >>> barrier.wait_for({"inv2": "State(41)", "inv3": "State(41)"}, now=2.0)
    >>> barrier.came("inv2"); barrier.heard("inv3", 40, now=2.0)
    >>> barrier.is_open, barrier.deadline
    (False, 12.0)
    >>> barrier.complaint(barrier.missing_messages(), now=12.0)
    'plant: no State(41) from inv3 within 10 s; last heard of inv3: tick 40, 10.0 s ago'
    """

    def __init__(self, who: str, timeout: float) -> None:
        self._who, self._timeout = who, timeout
        self._awaited: dict[str, str] = {}
        """What each of those should send who have not yet."""
        self._last: dict[str, tuple[int, float]] = {}
        self.deadline: float | None = None
        """When the present wait is over (s); None if it has no end."""

    @property
    def is_open(self) -> bool:
        """Whether nothing is missing any more."""
        return not self._awaited

    @property
    def messages_needed(self) -> int:
        """Number of messages that are missing; at least one."""
        return max(1, len(self._awaited))

    def wait_for(self, awaited: Mapping[str, str], now: float) -> None:
        """Begin a new wait: for what each of these should send."""
        self._awaited = dict(awaited)
        self.renew(now)

    def awaits(self, name: str) -> bool:
        """Whether something is awaited from somebody."""
        return name in self._awaited

    def came(self, name: str) -> None:
        """Note that somebody has sent what was awaited, or never will."""
        self._awaited.pop(name, None)

    def missing_messages(self) -> tuple[Awaited, ...]:
        """What is awaited, of whom."""
        return tuple(Awaited(what, who) for who, what in self._awaited.items())

    def heard(self, name: str, seq: int, now: float) -> None:
        """Note a sign of life: a message numbered `seq`."""
        self._last[name] = (seq, now)

    def renew(self, now: float) -> None:
        """Note progress: the deadline counts from now."""
        self.deadline = now + self._timeout

    def rest(self) -> None:
        """Wait without a deadline."""
        self.deadline = None

    def complaint(self, missing: tuple[Awaited, ...], now: float) -> str:
        """One sentence for the end of the deadline: who is missing, its last tick and its last sign of life."""
        parts = []
        for what, who in missing:
            if who in self._last:
                tick, at = self._last[who]
                sign = f"last heard of {who}: tick {tick}, {now - at:.1f} s ago"
            else:
                sign = f"nothing was ever heard from {who}"
            parts.append(f"no {what} from {who} within {self._timeout:g} s; {sign}")
        return f"{self._who}: " + ". ".join(parts)
