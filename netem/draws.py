r"""Random numbers that are looked up, not drawn: a function of seed, link, purpose, message number and index.

.. math:: u = \left(\lfloor h / 2^{12} \rfloor + \tfrac12\right) 2^{-52}, \qquad
          h = \mathrm{BLAKE2b}_{64}(\text{seed}, \text{src}, \text{dst}, \text{purpose}; \text{seq}, \text{index})

So an agent, a fault or a cut that is added changes no other fate, and a message has the same fate in simulated and in
real time, seen by whatever process, in whatever order (Salmon et al.).

References
----------
Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11. https://doi.org/10.1145/2063384.2063405
BLAKE2: RFC 7693.
"""

from __future__ import annotations

from collections.abc import Callable
from hashlib import blake2b
from statistics import NormalDist
from struct import Struct
from typing import Generic, TypeVar

_ROW = Struct("<qI").pack
_STANDARD = NormalDist()


class Stream:
    """The numbers of one link for one purpose, e.g. "loss": two faults of one kind get the same number at one index.

    Examples
    --------
    >>> stream = Stream(1, "inv1", "inv2", "loss")
    >>> stream.uniform(7) == Stream(1, "inv1", "inv2", "loss").uniform(7)
    True
    >>> round(stream.uniform(7), 6), round(stream.uniform(8), 6)
    (0.987347, 0.808745)
    """

    __slots__ = ("_state",)

    def __init__(self, seed: int, src: str, dst: str, purpose: str) -> None:
        # lengths first: ("a", "bc") and ("ab", "c") must not be one stream
        parts = [part.encode() for part in (str(seed), src, dst, purpose)]
        self._state = blake2b(b"".join(len(part).to_bytes(4, "little") + part for part in parts), digest_size=8)

    def uniform(self, seq: int, index: int = 0) -> float:
        """Return a number in the open interval (0, 1), on a grid of 2^-52."""
        state = self._state.copy()
        state.update(_ROW(seq, index))
        return ((int.from_bytes(state.digest(), "little") >> 12) + 0.5) * 2.0**-52

    def chance(self, p: float, seq: int) -> bool:
        """Return whether something of probability p happens to a message: `uniform(seq) < p`, in one call."""
        state = self._state.copy()
        state.update(_ROW(seq, 0))
        return ((int.from_bytes(state.digest(), "little") >> 12) + 0.5) * 2.0**-52 < p

    def normal(self, seq: int, index: int = 0) -> float:
        """Return a standard normal number, by the inverse of its distribution function."""
        return _STANDARD.inv_cdf(self.uniform(seq, index))

    def below(self, bound: int, seq: int, index: int = 0) -> int:
        """Return a whole number from 0 to bound - 1; bound at least 1 and far below 2^52."""
        return int(self.uniform(seq, index) * bound)


S = TypeVar("S")

RESTART = 4096
"""A chain starts anew from its stationary law at every multiple of this number. So a receiver that joins late, or
missed numbers, reaches the same state as one that saw all, after at most this many steps (some 3 ms); one dependence
in 4096 is cut, which no test of a run can see."""


class Chain(Generic[S]):
    """A Markov chain whose state is nevertheless a function of the message number alone.

    `first` gives the state at a number where the chain starts, from its stationary law; `step` gives that at any other
    number, from the state at the number before.

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
        start = seq - seq % RESTART
        if not start <= self._seq <= seq:
            self._seq, self._state = start, self._first(start)
        while self._seq < seq:
            self._seq += 1
            self._state = self._step(self._state, self._seq)
        return self._state
