"""Limit how often a repeated line is logged, and count the omitted ones. Time is an argument (s)."""

from __future__ import annotations

import re

BURST = 20
"""Lines of one kind that may come at once, such as those of all joining agents."""

INTERVAL = 10.0
"""Time (s) after which one more line may come."""

_KINDS = 200
"""Number of distinct kinds; all further lines count as one kind."""

_NUMBER = re.compile(r"[0-9]+(?:\.[0-9]+)?")


class RateLimit:
    """Pass the first lines of a kind, then one at each interval with the number of omitted ones.

    Lines that differ only in numbers are of one kind.

    Parameters
    ----------
    burst : int, optional
        Lines of a kind that may come at once.
    interval : float, optional
        Time (s) after which one more line may come.

    Examples
    --------
    >>> limit = RateLimit(burst=1, interval=10.0)
    >>> [limit.admit(f"late by {i} ms", now=float(i)) for i in range(3)]
    ['late by 0 ms', None, None]
    >>> limit.admit("late by 9 ms", now=11.0)
    'late by 9 ms (2 more of this kind left out)'
    >>> limit.admit("late by 9 ms", now=11.5), limit.left_out()
    (None, ['1 more of this kind left out, the last: late by 9 ms'])
    """

    def __init__(self, burst: int = BURST, interval: float = INTERVAL) -> None:
        self._burst, self._interval = burst, interval
        self._allowed: dict[str, tuple[float, float]] = {}
        """Number of lines of each kind that may come, and the time (s) of that number."""
        self._left: dict[str, tuple[int, str]] = {}
        """Number of omitted lines of each kind since the last one passed, and the latest of them."""

    def admit(self, text: str, now: float) -> str | None:
        """Return a line as it is, or with the number of omitted ones before it, or None to omit it."""
        kind = _NUMBER.sub("0", text)
        if kind not in self._allowed and len(self._allowed) >= _KINDS:
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
