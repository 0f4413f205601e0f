"""What the next tick of an agent in simulated time needs before it can be computed. Pure.

Measurement(k) is the grant of tick k. With it and State(k-1) of every in-neighbour on roster k-1 the agent computes and
sends State(k). A State(k) that overtakes the own Measurement(k) is kept back until tick k is done, so what is used
never depends on who was faster. Whoever is no longer on roster k is left out at once, so that it does not matter
whether its last state or its end is heard first. At its first tick an agent has no roster k-1 and listens to nobody.
"""

from __future__ import annotations

from collections.abc import Mapping

from wire.codec import RejectedError
from wire.messages import PLANT, Measurement, State
from wire.patience import Awaited


class Turn:
    """The next tick of one agent. Measurements and states in; it tells when they are complete.

    Examples
    --------
    At tick 0 the measurement is enough; after it the agent listens to inv2, whose state of tick 0 comes late.

    >>> def measured(k: int) -> Measurement:
    ...     return Measurement(sender="plant", incarnation=1, seq=k, t=0.02 * k, to="inv1", P=5e4, Q=0.0, V=277.0,
    ...         f=60.0, P_set=5e4, V_set=277.0, grid_connected=False, island="inv1", roster=("inv1", "inv2"))
    >>> turn = Turn()
    >>> turn.grant(measured(0))
    >>> turn.granted() is not None, turn.next({"inv2": "b"})
    (True, [])
    >>> turn.grant(measured(1))
    >>> turn.granted(), turn.missing()
    (None, (Awaited(what='State(0)', who='inv2'),))
    >>> state = State(sender="inv2", incarnation=1, seq=0, t=0.0, P_set=5e4, V_set=277.0, Q=0.0)
    >>> turn.take(state, b"..."), turn.granted() is not None
    (True, True)
    """

    def __init__(self) -> None:
        self.tick: int | None = None
        """Number of the tick; None until the first measurement has come."""
        self.waiting: dict[str, str] = {}
        """In-neighbours, and their instances, whose state of the tick before has not come yet."""
        self._measurement: Measurement | None = None
        self._early: dict[str, tuple[State, bytes]] = {}
        """The states of this tick that came before it was done, and their bytes."""

    @property
    def wanted(self) -> int:
        """Number of messages that are missing; at least one."""
        return max(1, len(self.waiting) + (self._measurement is None))

    def missing(self) -> tuple[Awaited, ...]:
        """What is awaited: the measurement, or else the states."""
        tick = self.tick or 0
        if self._measurement is None:
            return (Awaited(f"Measurement({tick})", PLANT),)
        return tuple(Awaited(f"State({tick - 1})", name) for name in self.waiting)

    def grant(self, measurement: Measurement) -> None:
        """Take the own measurement; the first says which tick it is.

        Raises
        ------
        RejectedError
            If it is not that of this tick, or here already.
        """
        seq = measurement.seq
        if self.tick is None:
            self.tick = seq
            self._early = {name: early for name, early in self._early.items() if early[0].seq == seq}
        if seq != self.tick or self._measurement is not None:
            kind = "unexpected" if seq > self.tick else "stale"
            raise RejectedError(kind, f"tick {seq}, but {self.tick} is next")
        self._measurement = measurement

    def take(self, state: State, payload: bytes) -> bool:
        """Take an in-neighbour's state; True if it is for this tick, False if it is kept back until this one is done.

        Raises
        ------
        RejectedError
            If it is for neither.
        """
        name, seq = state.sender, state.seq
        if self.tick is None or seq == self.tick:
            self._early[name] = state, payload
            return False
        if seq != self.tick - 1:
            kind = "stale" if seq < self.tick else "unexpected"
            raise RejectedError(kind, f"State({seq}) of {name} before tick {self.tick}")
        self.waiting.pop(name, None)
        return True

    def lost(self, name: str, instance: str) -> bool:
        """Note that a process is gone; whether its state was awaited, and no longer is."""
        if self.waiting.get(name) != instance:
            return False
        del self.waiting[name]
        return True

    def granted(self) -> Measurement | None:
        """The measurement, if nothing is missing; whoever is not on its roster is not."""
        measurement = self._measurement
        if measurement is not None and self.waiting:
            for name in self.waiting.keys() - set(measurement.roster):
                del self.waiting[name]
        return None if self.waiting else measurement

    def next(self, neighbours: Mapping[str, str]) -> list[tuple[State, bytes]]:
        """Go on to the tick after.

        Parameters
        ----------
        neighbours : Mapping[str, str]
            Whose states of this tick the next one needs, and their instances.

        Returns
        -------
        list[tuple[State, bytes]]
            The states that are here already, and their bytes.
        """
        assert self.tick is not None
        self.tick, self._measurement = self.tick + 1, None
        early, self._early = self._early, {}
        self.waiting = {name: instance for name, instance in neighbours.items() if name not in early}
        return list(early.values())
