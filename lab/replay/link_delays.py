"""Delays of messages on the links of a record, as they are met, for messages that the record does not have."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from statistics import median

MOST = 1000
"""Latest delays of a link that are kept."""


class LinkDelays:
    """Delays by sender and receiver.

    Examples
    --------
    >>> delays = LinkDelays()
    >>> for delay in (0.001, 0.003):
    ...     delays.note("inv1", "inv2", delay)
    >>> [delays.draw("inv1", "inv2") for _ in range(3)], delays.typical("inv1", "inv2")
    ([0.001, 0.003, 0.001], 0.002)

    A link on which nothing was heard takes those of the other links to its receiver:

    >>> delays.draw("inv3", "inv2"), delays.draw("inv1", "inv9")
    (0.001, 0.0)
    """

    def __init__(self) -> None:
        self._delays: dict[tuple[str, str], deque[float]] = {}
        self._drawn: dict[tuple[str, str], int] = {}

    def note(self, src: str, dst: str, delay: float) -> None:
        """Note the delay of a message of the record (s of wall time)."""
        self._delays.setdefault((src, dst), deque(maxlen=MOST)).append(delay)

    def draw(self, src: str, dst: str) -> float:
        """Return a delay (s): those of the link in their order, again and again."""
        known = self._known(src, dst)
        if not known:
            return 0.0
        number = self._drawn.get((src, dst), 0)
        self._drawn[src, dst] = number + 1
        return known[number % len(known)]

    def typical(self, src: str, dst: str) -> float:
        """Return the median delay of a link (s)."""
        known = self._known(src, dst)
        return median(known) if known else 0.0

    def _known(self, src: str, dst: str) -> list[float]:
        own = self._delays.get((src, dst))
        return list(own) if own else list(self._to(dst))

    def _to(self, receiver: str) -> Iterator[float]:
        return (delay for (_, dst), known in self._delays.items() if dst == receiver for delay in known)
