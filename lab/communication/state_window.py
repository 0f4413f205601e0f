"""The last states of an agent, while a pass over a record goes on."""

from __future__ import annotations

from array import array

from gridpeers.lab.communication.record_sink import SentState

KEPT = 8192
"""Number of states that a window holds: 2.7 minutes at a control period of 20 ms."""

_IDLE, _QUIET = 1, 2


class StateWindow:
    """The last states of one agent by number; of older ones it says that they are not there."""

    def __init__(self) -> None:
        self._numbers = array("q", [-1]) * KEPT
        self._t = array("d", [0.0]) * KEPT
        self._flags = bytearray(KEPT)
        self._latest = self._loud = -1
        """Latest number, and latest one of a state that was not quiet."""

    def put(self, state: SentState) -> bool:
        """Note a state; return whether it is new."""
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
        """Return whether a state of this number was sent."""
        return number >= 0 and self._numbers[number % KEPT] == number

    def numbers(self, after: int, until: int) -> list[int]:
        """Return the numbers behind one and up to another that were sent, in order; at most `KEPT`, however far."""
        if until - after > KEPT:
            return sorted(number for number in self._numbers if after < number <= until)
        return [number for number in range(after + 1, until + 1) if self.has(number)]

    def spoke(self, number: int) -> bool:
        """Return whether a state of this number was sent to the neighbours."""
        return self.has(number) and not self._flags[number % KEPT]

    def decided(self, number: int) -> bool:
        """Return whether the agent decided something with this number."""
        return self.has(number) and not self._flags[number % KEPT] & _IDLE

    def t(self, number: int) -> float | None:
        """Return when (s) the state of this number was sent; None if it is not there."""
        return self._t[number % KEPT] if self.has(number) else None

    def is_past(self, number: int) -> bool:
        """Return whether a number is too old for this window."""
        return number < 0 or self._numbers[number % KEPT] > number

    def kept_until(self, number: int) -> int:
        """Return the number up to which quiet states kept the one of this number in force: itself, if none did."""
        if self.is_past(number + 1):
            return number if self._loud > number else self._latest
        while self.has(number + 1) and self._flags[(number + 1) % KEPT] & _QUIET:
            number += 1
        return number
