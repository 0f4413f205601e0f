"""The tick policy of simulated time: continue when all messages of a tick are here, or name the missing ones. Pure."""

from __future__ import annotations

from typing import NamedTuple

STOOD_STILL = 1.0
"""Time (s) after a deadline. A process that is woken later was stopped itself, while its clock went on."""


class Awaited(NamedTuple):
    """One message that a node waits for."""

    message: str
    """E.g. "State(41)"."""
    sender: str
    """Name of its sender."""


class TickBarrier:
    """The awaited messages, their deadline, and the last sign of life of every sender.

    Parameters
    ----------
    name : str
        Name of the waiting node.
    timeout : float
        Longest wait without progress (s on the driver's clock).

    Examples
    --------
    >>> barrier = TickBarrier("plant", 10.0)
    >>> barrier.wait_for({"inv2": "State(41)", "inv3": "State(41)"}, now=2.0)
    >>> barrier.came("inv2"); barrier.last_heard["inv3"] = 40, 2.0
    >>> barrier.is_open, barrier.deadline
    (False, 12.0)
    >>> barrier.complaint(barrier.missing_messages(), now=12.0)
    'plant: no State(41) from inv3 within 10 s; last heard of inv3: tick 40, 10.0 s ago'
    """

    def __init__(self, name: str, timeout: float) -> None:
        self._name, self._timeout = name, timeout
        self._awaited: dict[str, str] = {}
        """Missing message of each sender."""
        self.siblings: frozenset[str] = frozenset()
        """Senders in the same process, whose messages do not come from outside."""
        self._from_outside = 0
        """Number of missing messages of the others."""
        self.last_heard: dict[str, tuple[int, float]] = {}
        """Number and time (s) of each sender's last message, its last sign of life; the node notes them."""
        self.deadline: float | None = None
        """End of the present wait (s); None if it has none."""

    @property
    def is_open(self) -> bool:
        """Whether no message is missing."""
        return not self._awaited

    @property
    def messages_needed(self) -> int:
        """Number of missing messages from outside; at least one."""
        return max(1, self._from_outside)

    def wait_for(self, awaited: dict[str, str], now: float) -> None:
        """Start a new wait for a message of each of these senders; the dict goes to the barrier."""
        self._awaited = awaited
        self._from_outside = len(self._awaited.keys() - self.siblings) if self.siblings else len(self._awaited)
        self.renew(now)

    def awaits(self, name: str) -> bool:
        """Whether a message of this sender is missing."""
        return name in self._awaited

    def came(self, name: str) -> None:
        """Note that a sender has sent its message, or never will."""
        if self._awaited.pop(name, None) is not None and name not in self.siblings:
            self._from_outside -= 1

    def missing_messages(self) -> tuple[Awaited, ...]:
        """Return the missing messages with their senders."""
        return tuple(Awaited(message, sender) for sender, message in self._awaited.items())

    def renew(self, now: float) -> None:
        """Note progress: the deadline restarts from now."""
        self.deadline = now + self._timeout

    def is_over(self, now: float) -> bool:
        """Whether the deadline has passed.

        A process that is woken much later than it asked for was stopped itself, as by Ctrl-Z or a closed lid. Messages
        may be waiting for it, so the deadline starts again.
        """
        if self.deadline is None or now < self.deadline:
            return False
        if now > self.deadline + STOOD_STILL:
            self.renew(now)
            return False
        return True

    def rest(self) -> None:
        """Wait without a deadline."""
        self.deadline = None

    def complaint(self, missing: tuple[Awaited, ...], now: float) -> str:
        """Return the error of a passed deadline: each missing sender with its last tick and last sign of life."""
        parts = []
        for message, sender in missing:
            if sender in self.last_heard:
                tick, at = self.last_heard[sender]
                sign = f"last heard of {sender}: tick {tick}, {now - at:.1f} s ago"
            else:
                sign = f"nothing was ever heard from {sender}"
            parts.append(f"no {message} from {sender} within {self._timeout:g} s; {sign}")
        return f"{self._name}: " + ". ".join(parts)
