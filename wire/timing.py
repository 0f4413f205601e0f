"""Ticks, schedules and deadlines of a node, and how often a line of its log comes. Pure: time is an argument (s)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import NamedTuple


def time_of(tick: int, T_c: float) -> float:
    """Return the run time (s) of a tick: a product, so that every process computes the same bits."""
    return round(tick * T_c, 9)


def ticks_until(end: float, T_c: float) -> int:
    """Return the number of control periods T_c (s) from 0 to `end` (s), which must be a multiple."""
    if T_c <= 0.0:
        raise ValueError(f"T_c: the control period must be positive, got {T_c:g} s")
    ticks = round(end / T_c)
    if ticks < 1 or abs(ticks * T_c - end) > 1e-9 * max(1.0, end):
        raise ValueError(f"end: must be a positive multiple of the control period {T_c:g} s, got {end:g} s")
    return ticks


def rounded_up(t: float, T_c: float) -> float:
    """Return the first end (s) of a run at or after t (s): a whole number of control periods T_c (s), one at least."""
    return time_of(max(1, math.ceil(t / T_c - 1e-6)), T_c)


class Timer:
    def __init__(self, period: float, now: float) -> None:
        self.period = period
        self._start = now
        self._n = 0

    @property
    def due(self) -> float:
        return self._start + self._n * self.period

    def take(self, now: float) -> int:
        """Move on to the first due time after now; return how many due times between were missed."""
        past = max(0, int((now - self.due) / self.period))
        self._n += past + 1
        return past


STOOD_STILL = 1.0
"""Time (s) after a deadline. A process that wakes later was stopped itself, while its clock continued."""


class Awaited(NamedTuple):
    message: str
    """E.g. "State(41)"."""
    sender: str


class TickBarrier:
    """The awaited messages, their deadline after `timeout` (s) without progress, and the last sign of life of all."""

    def __init__(self, name: str, timeout: float) -> None:
        self._name, self.timeout = name, timeout
        self.awaited: dict[str, str] = {}
        """The awaited message of each sender."""
        self.siblings: set[str] = set()
        """Senders in the same process, whose messages do not come from outside."""
        self.last_heard: dict[str, tuple[int, float]] = {}
        """Number and time (s) of each sender's last message, its last sign of life; the node notes them."""
        self.deadline: float | None = None

    @property
    def messages_needed(self) -> int:
        return max(1, len(self.awaited.keys() - self.siblings) if self.siblings else len(self.awaited))

    def wait_for(self, awaited: dict[str, str], now: float) -> None:
        self.awaited = awaited
        self.renew(now)

    def missing_messages(self) -> tuple[Awaited, ...]:
        return tuple(Awaited(message, sender) for sender, message in self.awaited.items())

    def renew(self, now: float) -> None:
        self.deadline = now + self.timeout

    def is_over(self, now: float) -> bool:
        """Whether the deadline has passed; it starts again if this process was stopped itself, as by Ctrl-Z."""
        if self.deadline is None or now < self.deadline:
            return False
        if now > self.deadline + STOOD_STILL:
            self.renew(now)
            return False
        return True

    def rest(self) -> None:
        self.deadline = None

    def complaint(self, missing: tuple[Awaited, ...], now: float) -> str:
        parts = []
        for message, sender in missing:
            sign = f"nothing was ever heard from {sender}"
            if sender in self.last_heard:
                tick, at = self.last_heard[sender]
                sign = f"last heard of {sender}: tick {tick}, {now - at:.1f} s ago"
            parts.append(f"no {message} from {sender} within {self.timeout:g} s; {sign}")
        return f"{self._name}: " + ". ".join(parts)


PATIENCE = 3.5
"""Silence (s) after which a new session opens. It exceeds Zenoh's lease, so the others have forgotten the old session.
It doubles, up to `LONGEST`, after a session that never worked."""

LONGEST = 60.0  # Longest patience (s): a path that stays cut must not keep a process busy with sessions


class SessionDeadline:
    """Measure how long (s) each sender has been silent in this session."""

    def __init__(self, patience: float = PATIENCE) -> None:
        self.whole = False
        self._patience = patience
        self._since: dict[str, float] = {}

    def next(self) -> SessionDeadline:
        """Return the patience of the next session: twice as long if this session never worked."""
        return SessionDeadline(PATIENCE if self.whole else min(2.0 * self._patience, LONGEST))

    def lost(self, silent: Mapping[str, float], now: float) -> str:
        """Note the senders that are wrongly silent now; return the first that has been so too long, else "".

        Each comes with the time (s) by which it may be silent longer than the patience.
        """
        self._since = {name: self._since.get(name, now) for name in silent}
        return next((name for name, since in self._since.items() if now - since >= self._patience + silent[name]), "")


MOST_KINDS = 200  # Kinds of lines that a limit tells apart

_NUMBER = re.compile(r"[0-9]+(?:\.[0-9]+)?")


class RateLimit:
    """Pass the first lines of a kind, then one at each interval (s) with the number of omitted ones.

    Lines that differ only in numbers are of one kind. All lines beyond 200 kinds are of one kind, too.
    """

    def __init__(self, burst: int = 20, interval: float = 10.0) -> None:
        self._burst, self._interval = burst, interval
        self._allowed: dict[str, tuple[float, float]] = {}
        """Number of lines of each kind that may come, and the time (s) of that number."""
        self._left: dict[str, tuple[int, str]] = {}

    def admit(self, text: str, now: float) -> str | None:
        """Return a line as it is, or with the number of omitted ones before it, or None to omit it."""
        kind = _NUMBER.sub("0", text)
        if kind not in self._allowed and len(self._allowed) >= MOST_KINDS:
            kind = ""
        allowed, since = self._allowed.get(kind, (float(self._burst), now))
        allowed = min(float(self._burst), allowed + (now - since) / self._interval)
        left, _ = self._left.pop(kind, (0, ""))
        if allowed < 1.0:
            self._allowed[kind] = allowed, now
            self._left[kind] = left + 1, text
            return None
        self._allowed[kind] = allowed - 1.0, now
        return f"{text} ({left} more of this kind left out)" if left else text

    def left_out(self) -> list[str]:
        """Take out one line per kind on its omitted lines, e.g. at the end."""
        left, self._left = self._left, {}
        return [f"{count} more of this kind left out, the last: {text}" for count, text in left.values()]
