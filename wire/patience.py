"""Waiting with a deadline that can say for whom it waited. Time is an argument: s on the driver's own clock."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Awaited(NamedTuple):
    """One message that is waited for."""

    what: str
    """E.g. "State(41)"."""
    who: str
    """Who should send it."""


class Patience:
    """When a wait began, and the last sign of life of everybody.

    Parameters
    ----------
    who : str
        Who waits.
    deadline : float
        Longest wait without progress (s).

    Examples
    --------
    >>> patience = Patience("plant", 10.0)
    >>> patience.heard("inv3", 40, now=2.0)
    >>> patience.complaint([Awaited("State(41)", "inv3")], now=12.0)
    'plant: no State(41) from inv3 within 10 s; last heard of inv3: tick 40, 10.0 s ago'
    """

    def __init__(self, who: str, deadline: float) -> None:
        self._who = who
        self._deadline = deadline
        self._last: dict[str, tuple[int, float]] = {}
        self.until: float | None = None
        """When the present wait is over (s); None if it has no end."""

    def heard(self, name: str, seq: int, now: float) -> None:
        """Note a sign of life: a message numbered `seq`."""
        self._last[name] = (seq, now)

    def last_tick(self, name: str) -> int | None:
        """Number of the last message from somebody, None if there was none."""
        return self._last[name][0] if name in self._last else None

    def renew(self, now: float) -> None:
        """Something awaited has come; the next wait begins."""
        self.until = now + self._deadline

    def rest(self) -> None:
        """Nothing with a deadline is awaited."""
        self.until = None

    def complaint(self, awaited: Iterable[Awaited], now: float) -> str:
        """One sentence for the end of the deadline: who is missing, its last tick and its last sign of life."""
        parts = []
        for what, who in awaited:
            if who in self._last:
                tick, at = self._last[who]
                sign = f"last heard of {who}: tick {tick}, {now - at:.1f} s ago"
            else:
                sign = f"nothing was ever heard from {who}"
            parts.append(f"no {what} from {who} within {self._deadline:g} s; {sign}")
        return f"{self._who}: " + ". ".join(parts)
