"""The last measurement and the last states that an agent heard, with their ages. Pure.

Times are run time (s). Simulated time takes them from the ticks. In real time the agent counts them on its
own clock, from an origin of its own.
"""

from __future__ import annotations

from math import inf

from gridpeers.wire.messages import Measurement, State


class NeighbourStates:
    """Keep the own last measurement and each neighbour's last state that the links delivered.

    Examples
    --------
    The age of a state counts from its arrival; but a state that was long on its way is as old as its own time:

    >>> states = NeighbourStates()
    >>> states.keep(State(sender="inv2", epoch=1, seq=7, t=0.5, P_set=0.0, V_set=0.0, Q=0.0), at=10.0)
    >>> states.age("inv2", at=10.25), states.age("inv3", at=10.25)
    (0.25, inf)
    >>> states.keep(Measurement(sender="plant", epoch=1, seq=100, t=2.0, to="inv1", P=0.0, Q=0.0, V=277.0, f=60.0,
    ...     P_set=0.0, V_set=277.0, grid_connected=False, island="inv1", roster=()), at=10.25)
    >>> states.t, states.age("inv2", at=10.25)
    (2.0, 1.5)
    """

    def __init__(self) -> None:
        self._states: dict[str, tuple[State, float]] = {}
        """Last state of each agent, and its time of arrival (s)."""
        self.measurement: Measurement | None = None
        """The own last measurement; None before the first."""
        self._measured_at = 0.0

    def keep(self, message: State | Measurement, at: float) -> None:
        """Keep a state or the own measurement, which arrived at this time (s)."""
        if isinstance(message, State):
            self._states[message.sender] = message, at
        else:
            self.measurement, self._measured_at = message, at

    @property
    def t(self) -> float:
        """Time written in the own measurement (s of run time); 0 if there is none."""
        return 0.0 if self.measurement is None else self.measurement.t

    def measured(self, at: float, max_age: float) -> Measurement | None:
        """Return the own measurement if it arrived at most `max_age` (s) ago, else None."""
        return None if round(at - self._measured_at, 9) > max_age else self.measurement

    def age(self, name: str, at: float) -> float:
        """Return the age of a neighbour's last state (s); infinite if there is none.

        It is the greater of the time since its arrival, and of its own time before the own measurement's.
        """
        if name not in self._states:
            return inf
        state, arrived_at = self._states[name]
        return max(at - arrived_at, self.t - state.t)

    def forget(self, name: str) -> None:
        """Forget an agent whose process is gone."""
        self._states.pop(name, None)

    def clear(self) -> None:
        """Forget every state and the measurement."""
        self._states.clear()
        self.measurement = None
