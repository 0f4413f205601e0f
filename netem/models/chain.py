"""A Markov chain whose state is nevertheless a function of the message number alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

S = TypeVar("S")

RESTART = 4096
"""A chain starts anew from its stationary law at every multiple of this number. So a receiver that joins late, or
missed numbers, reaches the same state as one that saw all, after at most this many steps (some 3 ms); one dependence
in 4096 is cut, which no test of a run can see."""


class Chain(Generic[S]):
    """State of a Markov chain at a message number.

    Parameters
    ----------
    first : Callable[[int], S]
        State at a number where the chain starts, from its stationary law.
    step : Callable[[S, int], S]
        State at a number, from the state at the number before.

    Examples
    --------
    >>> chain = Chain(lambda seq: seq, lambda state, seq: state + 1)
    >>> chain.at(7), chain.at(3), chain.at(4097)
    (7, 3, 4097)
    """

    __slots__ = ("_first", "_seq", "_state", "_step")

    def __init__(self, first: Callable[[int], S], step: Callable[[S, int], S]) -> None:
        self._first, self._step = first, step
        self._seq = 0
        self._state = first(0)

    def at(self, seq: int) -> S:
        """Return the state at message `seq`."""
        start = seq - seq % RESTART
        if not start <= self._seq <= seq:
            self._seq, self._state = start, self._first(start)
        while self._seq < seq:
            self._seq += 1
            self._state = self._step(self._state, self._seq)
        return self._state
