"""The last states that each agent sent, while a pass over a record goes on."""

from __future__ import annotations

from array import array
from math import inf
from typing import NamedTuple

Link = tuple[str, str]  # Sender and receiver

KEPT = 8192  # Number of states that a window holds: 2.7 minutes at a control period of 20 ms

WINDOWS = 3
"""Number of processes of which states are kept: decisions are looked at some seconds later, when others may speak."""

_IDLE, _QUIET = 1, 2


class SentState(NamedTuple):
    """A state that an agent sent, at a run time t (s)."""

    number: int
    t: float
    epoch: int
    idle: bool
    """The agent decided nothing: it was paused, or had no measurement."""
    quiet: bool
    """It was not for the neighbours: the law kept its last state in force."""


class StateWindow:
    """The last states of one process by number; older ones are absent."""

    def __init__(self) -> None:
        self._numbers = array("q", [-1]) * KEPT
        self._t = array("d", [0.0]) * KEPT
        self._flags = bytearray(KEPT)
        self._latest = self._loud = -1
        """Latest number, and latest one of a state that was not quiet."""

    def put(self, state: SentState) -> bool:
        at = state.number % KEPT
        if self._numbers[at] >= state.number:
            return False
        self._numbers[at], self._t[at] = state.number, state.t
        self._flags[at] = _IDLE * state.idle | _QUIET * state.quiet
        self._latest = max(self._latest, state.number)
        if not state.quiet:
            self._loud = max(self._loud, state.number)
        return True

    def has(self, number: int) -> bool:
        return number >= 0 and self._numbers[number % KEPT] == number

    def spoke(self, number: int) -> bool:
        """Return whether a state of this number was sent to the neighbours."""
        return self.has(number) and not self._flags[number % KEPT]

    def decided(self, number: int) -> bool:
        return self.has(number) and not self._flags[number % KEPT] & _IDLE

    def t(self, number: int) -> float | None:
        return self._t[number % KEPT] if self.has(number) else None

    def is_past(self, number: int) -> bool:
        return number < 0 or self._numbers[number % KEPT] > number

    def kept_until(self, number: int) -> int:
        """Return the number up to which quiet states kept the one of this number in force."""
        if self.is_past(number + 1):
            return number if self._loud > number else self._latest
        while self.has(number + 1) and self._flags[(number + 1) % KEPT] & _QUIET:
            number += 1
        return number


_NONE = StateWindow()  # Of an agent that has sent nothing


class SentStates:
    """The last states of an agent, and when each of its processes spoke first and last.

    In simulated time a state's number is its tick, whichever process sent it; in real time every process counts anew.
    """

    def __init__(self, *, simulated: bool) -> None:
        self._simulated = simulated
        self._windows: dict[int, StateWindow] = {}
        self.epochs: dict[int, tuple[float, float]] = {}
        """Run time (s) of the first and of the last state of each process, by its epoch."""
        self.spoke_at = -inf
        """Run time (s) of the last state that was for the neighbours."""

    def window_at(self, t: float) -> StateWindow:
        found = _NONE
        for epoch, window in self._windows.items():
            if self._simulated or self.epochs[epoch][0] <= t:
                found = window
        return found

    def window_of(self, epoch: int) -> StateWindow | None:
        return self._windows.get(0 if self._simulated else epoch)

    def put(self, state: SentState) -> bool:
        epoch = 0 if self._simulated else state.epoch
        if epoch not in self._windows:
            if epoch in self.epochs:
                return False  # it is not kept any more
            if len(self._windows) == WINDOWS:
                del self._windows[next(iter(self._windows))]  # epochs have no order: the one that came first goes
            self._windows[epoch] = StateWindow()
        if not self._windows[epoch].put(state):
            return False
        first, last = self.epochs.get(state.epoch, (state.t, state.t))
        self.epochs[state.epoch] = min(first, state.t), max(last, state.t)
        if not (state.idle or state.quiet):
            self.spoke_at = max(self.spoke_at, state.t)
        return True
