"""What was heard of whom, and how old it is. Pure; times are on the own clock (s, wall), ages in s of run time."""

from __future__ import annotations

from wire.messages import Measurement, State


class Heard:
    """What came from the plant and the neighbours.

    Parameters
    ----------
    speed : float
        Run time per wall time (s/s).

    Examples
    --------
    The age of a state counts from its arrival; but one that was long on its way is as old as its time says:

    >>> heard = Heard(speed=1.0)
    >>> state = State(sender="inv2", incarnation=1, seq=7, t=0.5, P_set=0.0, V_set=0.0, Q=0.0, island="")
    >>> heard.came("inv2", now=10.0)
    >>> heard.keep(state, now=10.0)
    >>> heard.age("inv2", now=10.25), heard.age("inv3", now=10.25)
    (0.25, inf)
    >>> heard.keep(Measurement(sender="plant", incarnation=1, seq=100, t=2.0, to="inv1", P=0.0, Q=0.0, V=277.0, f=60.0,
    ...     P_set=0.0, V_set=277.0, grid_connected=False, island="inv1", roster=()), now=10.25)
    >>> heard.t, heard.age("inv2", now=10.25)
    (2.0, 1.5)
    """

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._came: dict[str, float] = {}
        """When the last message of each came off the wire."""
        self._kept: dict[str, tuple[State, float]] = {}
        """Last state of each agent that the links let through, and when."""
        self.measurement: Measurement | None = None
        """The own measurement that counts: the last that the link from the plant let through."""
        self._measured_at = 0.0

    def came(self, name: str, now: float) -> None:
        """Note that something came off the wire from somebody."""
        self._came[name] = now

    def has(self, name: str) -> bool:
        """Whether anything has come from somebody."""
        return name in self._came

    def silence(self, name: str, now: float) -> float:
        """Time (s, wall) since something came from somebody; infinite if nothing has."""
        return now - self._came[name] if name in self._came else float("inf")

    def keep(self, message: State | Measurement, now: float) -> None:
        """Note what may be used: a state, or the own measurement."""
        if isinstance(message, State):
            self._kept[message.sender] = message, now
        else:
            self.measurement, self._measured_at = message, now

    @property
    def t(self) -> float:
        """Run time of the own measurement (s); 0 if there is none."""
        return 0.0 if self.measurement is None else self.measurement.t

    def measured(self, now: float, max_age: float) -> Measurement | None:
        """The own measurement, if it came not longer ago than `max_age` (s of run time)."""
        return None if (now - self._measured_at) * self._speed > max_age else self.measurement

    def age(self, name: str, now: float) -> float:
        """Age of somebody's last state (s of run time); infinite if there is none.

        That since it came, or that by its own time beside the own measurement's, if that is more.
        """
        if name not in self._kept:
            return float("inf")
        state, at = self._kept[name]
        return max((now - at) * self._speed, self.t - state.t)

    def forget(self, name: str) -> None:
        """Forget all of somebody, as its process is gone."""
        self._came.pop(name, None)
        self._kept.pop(name, None)

    def forget_all(self) -> None:
        """Forget everybody."""
        self._came.clear()
        self.drop()

    def drop(self) -> None:
        """Use nothing that has come so far: it is of no use any more."""
        self._kept.clear()
        self.measurement = None
