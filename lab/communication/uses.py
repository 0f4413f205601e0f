"""Which state of which neighbour an agent's decisions used, in order, while a pass over a record goes on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from gridpeers.lab.communication.sent_states import Link, SentState, SentStates
from gridpeers.scenarios.record.decision_entries import Hole, inside
from gridpeers.wire.journal import Decision

MOST = 20_000  # States of an agent that wait for its journal at most: it may be lost, and the agent go on


class NeighbourUse(NamedTuple):
    """A neighbour at one decision, or at several that treat it alike."""

    link: Link
    """The neighbour, and the agent."""
    ticks: int | None
    """Simulated time: age of its state; None if there was none."""
    number: int | None
    """Real time: number of its state; None if there was none."""
    age: float | None
    """Age of that state (s); None if there was none."""
    unused: str
    """Why it was left out (`gridpeers.wire.journal.UNUSED`); empty if it was used."""

    def number_at(self, own: int) -> int | None:
        """Return the number of the neighbour's state at the decision from which the own state `own` came."""
        return self.number if self.ticks is None else own - self.ticks


class Uses(NamedTuple):
    """All neighbours at one decision, or at several that treat them alike."""

    each: tuple[NeighbourUse, ...]
    last_tick: frozenset[str] | None
    """The neighbours, if the states of all are of the tick before; None else."""


Used = tuple[SentState, Uses, bool]
"""A state of an agent that was not idle, what the decision behind it used, and True if that decision is a new one."""


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

    def __init__(self, agent: str, T_c: float, holes: Sequence[Hole]) -> None:
        self._agent, self._T_c, self._holes = agent, T_c, holes
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
            if self._uses is not None and not state.idle and not inside(self._holes, state.t):
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
