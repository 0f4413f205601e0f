"""A bounded cache in which what is needed for events to come stays, however much else comes and goes. Pure."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from typing import Generic, TypeVar

ROOM = 64
"""Values that are foreseen that are kept: a factored network of 123 nodes has 1 MB."""

OTHERS = 8
"""Values that are not foreseen that are kept: a person who switches to and fro needs a few. With 64 a plant grew by
10 MB in an hour in which loads were set to ever new powers."""

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class ForeseenCache(Generic[K, V]):
    """Values by key; of more than `OTHERS` that are not foreseen the one goes that was not asked for for longest.

    The first `ROOM` values that are foreseen stay. Further ones, as of a schedule with hundreds of events, count as
    others: none may keep an unbounded part of the memory.

    Examples
    --------
    >>> cache = ForeseenCache()
    >>> cache.get("event", lambda: [1], foreseen=True)
    [1]
    >>> for number in range(OTHERS + 1):
    ...     kept = cache.get(number, lambda: [2])
    >>> "event" in cache, 0 in cache, 1 in cache
    (True, False, True)
    """

    def __init__(self) -> None:
        self._foreseen: dict[K, V] = {}
        self._others: dict[K, V] = {}

    def __iter__(self) -> Iterator[K]:
        yield from self._foreseen
        yield from self._others

    def get(self, key: K, make: Callable[[], V], *, foreseen: bool = False) -> V:
        """Return the value of a key; make it if it is not there.

        Parameters
        ----------
        key
            What it is for.
        make
            Makes it.
        foreseen
            Whether an event to come needs it, so that it stays.
        """
        if key in self._foreseen:
            return self._foreseen[key]
        stays = foreseen and len(self._foreseen) < ROOM
        value = self._others.pop(key) if key in self._others else make()
        if not stays and len(self._others) == OTHERS:
            del self._others[next(iter(self._others))]
        (self._foreseen if stays else self._others)[key] = value
        return value
