"""What the agents have said to a plant in wall-clock time, until it is held. Pure; times are on the driver's clock."""

from __future__ import annotations

from collections.abc import Iterable

from wire.messages import State

HEARD = 1.0
"""Time (s, wall) after its last state for which an agent is told to the others as one that is heard."""


class Heard:
    """The last state of each agent, and when it came.

    Examples
    --------
    >>> heard = Heard()
    >>> for seq in (7, 8):
    ...     state = State(sender="inv2", incarnation=1, seq=seq, t=0.5, P_set=0.0, V_set=0.0, Q=0.0, island="")
    ...     heard.came("inv2", now=10.0)
    ...     heard.keep(state)
    >>> [state.seq for state in heard.take()], heard.take()
    ([8], ())
    >>> heard.roster(("inv1", "inv2"), now=10.5), heard.roster(("inv1", "inv2"), now=11.5)
    (('inv2',), ())
    """

    def __init__(self) -> None:
        self._came: dict[str, float] = {}
        """When the last state of each agent came off the wire."""
        self._kept: dict[str, State] = {}
        """Those that the links let through and that are not held yet."""

    def came(self, name: str, now: float) -> None:
        """Note that a state came off the wire."""
        self._came[name] = now

    def keep(self, state: State) -> None:
        """Note a state that is to be held at the next step, instead of any before."""
        self._kept[state.sender] = state

    def take(self) -> tuple[State, ...]:
        """Take out what is to be held."""
        states, self._kept = tuple(self._kept.values()), {}
        return states

    def roster(self, names: Iterable[str], now: float) -> tuple[str, ...]:
        """Whom of these the plant has heard of late."""
        return tuple(name for name in names if name in self._came and now - self._came[name] < HEARD)

    def forget(self, name: str) -> None:
        """Forget an agent that is gone."""
        self._came.pop(name, None)
        self._kept.pop(name, None)
