"""The states that one agent sent, while a pass over a record goes on."""

from __future__ import annotations

from math import inf

from gridpeers.lab.communication.record_sink import SentState
from gridpeers.lab.communication.state_window import StateWindow

_WINDOWS = 3
"""Number of processes of which states are kept: decisions are looked at some seconds later, when others may speak."""

_NONE = StateWindow()
"""Of an agent that has sent nothing."""


class SentStates:
    """The last states of an agent, and when each of its processes spoke first and last.

    In simulated time a state's number is its tick, whichever process sent it; in wall-clock time every process counts
    anew.
    """

    def __init__(self, *, simulated: bool) -> None:
        self._simulated = simulated
        self._windows: dict[int, StateWindow] = {}
        self.epochs: dict[int, tuple[float, float]] = {}
        """Run time (s) of the first and of the last state of each process, by its epoch."""
        self.spoke_at = -inf
        """Run time (s) of the last state that was for the neighbours."""

    def window_at(self, t: float) -> StateWindow:
        """Return the states of the process that spoke last at a run time (s)."""
        found = _NONE
        for epoch, window in self._windows.items():
            if self._simulated or self.epochs[epoch][0] <= t:
                found = window
        return found

    def window_of(self, epoch: int) -> StateWindow | None:
        """Return the states of a process; None if they are not there any more."""
        return self._windows.get(0 if self._simulated else epoch)

    def put(self, state: SentState) -> bool:
        """Note a state; return whether it is new."""
        epoch = 0 if self._simulated else state.epoch
        if epoch not in self._windows:
            if epoch in self.epochs:
                return False  # it is not kept any more
            if len(self._windows) == _WINDOWS:
                del self._windows[next(iter(self._windows))]  # epochs have no order: the one that came first goes
            self._windows[epoch] = StateWindow()
        if not self._windows[epoch].put(state):
            return False
        first, last = self.epochs.get(state.epoch, (state.t, state.t))
        self.epochs[state.epoch] = min(first, state.t), max(last, state.t)
        if not (state.idle or state.quiet):
            self.spoke_at = max(self.spoke_at, state.t)
        return True
