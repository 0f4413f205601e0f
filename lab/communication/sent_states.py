"""The last states that each agent sent, and the decisions that used them, while a pass over a record goes on."""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Iterator
from math import inf
from typing import NamedTuple

from gridpeers.scenarios.record.decision_reader import JournalEnds
from gridpeers.wire.journal import Decision

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


# -------------------------------------------------------------------- the decisions that used them


MOST = 20_000  # States of an agent that wait for its journal at most: it may be lost, and the agent go on


class NeighbourUse(NamedTuple):
    link: Link
    ticks: int | None
    """Simulated time: age of its state; None if there was none."""
    number: int | None
    """Real time: number of its state; None if there was none."""
    age: float | None
    """Age of that state (s); None if there was none."""
    unused: str
    """Why it was left out (`gridpeers.wire.journal.Decision`); empty if it was used."""

    def number_at(self, own: int) -> int | None:
        """Return the number of the neighbour's state at the decision from which the own state `own` came."""
        return self.number if self.ticks is None else own - self.ticks


class Uses(NamedTuple):
    """All neighbours at one decision, or at several that treat them alike."""

    each: tuple[NeighbourUse, ...]
    last_tick: frozenset[str] | None
    """The neighbours, if the states of all are of the tick before; None else."""


Used = tuple[SentState, Uses, bool]
"""A state of an agent that was not idle; the uses of the decision behind it; True if that decision is a new one."""


def uses_of(agent: str, decision: Decision, T_c: float, *, simulated: bool) -> Uses:
    found = []
    unused, weights, ages = decision.unused, decision.weights, decision.ages
    for i, name in enumerate(decision.neighbours):
        said = decision.states[i] if i < len(decision.states) else None
        why = unused[i] if i < len(unused) else ""
        if not why and i < len(weights) and weights[i] == 0.0:
            why = "weight 0"
        if simulated:
            age = None if said is None else said * T_c
            found.append(NeighbourUse((name, agent), said, None, age, why))
        else:
            found.append(NeighbourUse((name, agent), None, said, ages[i] if i < len(ages) else None, why))
    alike = simulated and all(use.ticks == 1 for use in found)
    return Uses(tuple(found), frozenset(decision.neighbours) if alike else None)


class DecidedTicks:
    """The states of one agent in simulated time, each with the decision in force."""

    def __init__(self, agent: str, T_c: float, journal_ends: JournalEnds) -> None:
        self._agent, self._T_c, self._ends = agent, T_c, journal_ends
        self._states: deque[SentState] = deque(maxlen=MOST)
        self._coming: deque[Decision] = deque()
        self._uses: Uses | None = None
        self._new = False

    def state(self, state: SentState) -> None:
        self._states.append(state)

    def decision(self, epoch: int, decision: Decision) -> None:
        self._coming.append(decision)

    def flush(self, until: float) -> Iterator[Used]:
        while self._states and self._states[0].t <= until:
            state = self._states.popleft()
            while self._coming and self._coming[0].tick <= state.number:
                self._uses = uses_of(self._agent, self._coming.popleft(), self._T_c, simulated=True)
                self._new = True
            known = self._ends.know(self._agent, state.epoch, state.t)
            if self._uses is not None and not state.idle and known:
                yield state, self._uses, self._new
                self._new = False


class DecidedStates:
    """The decisions of one agent in real time, each with the state that came out."""

    def __init__(self, agent: str, T_c: float, sent: SentStates) -> None:
        self._agent, self._T_c, self._sent = agent, T_c, sent
        self._decisions: deque[tuple[float, int, Decision]] = deque()
        self._now = 0.0

    def state(self, state: SentState) -> None:
        self._now = max(self._now, state.t)

    def decision(self, epoch: int, decision: Decision) -> None:
        self._decisions.append((self._now, epoch, decision))

    def flush(self, until: float) -> Iterator[Used]:
        while self._decisions:
            came, epoch, decision = self._decisions[0]
            window = self._sent.window_of(epoch)
            t = None if window is None else window.t(decision.tick)
            if (came if t is None else t) > until:
                return
            self._decisions.popleft()
            if window is not None and t is not None and window.decided(decision.tick):
                state = SentState(decision.tick, t, epoch, idle=False, quiet=False)
                yield state, uses_of(self._agent, decision, self._T_c, simulated=False), True
