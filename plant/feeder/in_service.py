"""Which inverters are on the network: who trips, who comes back, and what an agent that comes or goes changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from plant.dynamics import Dynamics
from plant.feeder.protection import ATTEMPTS, Recovery, Relays
from plant.plant_config import Protection

Tell = Callable[[int, Literal["inverter", "trip"], str, str], None]
"""Takes an event: step, kind, subject, text."""

Settle = Callable[[int, list[int]], None]
"""Called after inverters were switched at a step: reads them anew, and tells of islands."""


class InService:
    """Connects and disconnects the inverters of a feeder, as agents, protection and the network have it.

    An inverter that trips comes back by itself when voltage and frequency at its terminals have been normal for the
    delay. Where nothing feeds its island any more, all that tripped there come back at once when the last of them has
    waited as long: a black start, of which a GFM must be part. There is no load shedding, so whoever starts an island
    takes its whole load; an inverter that trips again and again is left off.

    Parameters
    ----------
    settings
        Trip settings and delay.
    names
        The inverters.
    V_nom
        Their nominal voltages (V).
    dynamics
        The inverters and their network.
    wanted
        Which are to be on the network at the start.
    tell, settle
        See `Tell` and `Settle`.
    """

    def __init__(
        self,
        settings: Protection,
        names: tuple[str, ...],
        V_nom: NDArray[np.float64],
        dynamics: Dynamics,
        wanted: list[bool],
        tell: Tell,
        settle: Settle,
    ) -> None:
        self._names, self._V_nom, self._dynamics = names, V_nom, dynamics
        self._tell, self._settle = tell, settle
        self._wanted = np.array(wanted)
        self._joining: set[int] = set()
        """Whose agent has come, and who waits for others to start the island with."""
        self._relays = Relays(settings, len(names), dynamics.h, dynamics.inverters.f_nom)
        self._recovery = Recovery(settings.enter_service, len(names), dynamics.h, dynamics.inverters.f_nom)

    def has_tripped(self, i: int) -> bool:
        """Whether an inverter is off because it tripped."""
        return bool(self._recovery.tripped[i])

    @property
    def quiet(self) -> int:
        """Steps within which nobody trips or comes back."""
        return min(self._relays.quiet, self._recovery.quiet)

    def connect(self, i: int, step: int, *, on: bool) -> None:
        """Put an inverter on the network, at zero current and in step with it, or take it off, as its agent wants.

        One that has tripped waits on until it may come back. A GFM that comes into an island that nothing feeds, with
        inverters that have tripped there, starts it together with them, as soon as they have waited long enough.
        """
        name, recovery = self._names[i], self._recovery
        if bool(self._wanted[i]) == on and not (on and recovery.tripped[i]):
            return
        self._wanted[i] = on
        here = np.flatnonzero(recovery.tripped & self._with(i)).tolist()
        if not on:
            recovery.forget(i)
            self._joining.discard(i)
            self._dynamics.switch_inverter(i, False)
            self._tell(step, "inverter", name, f"{name} disconnected")
            self._settle(step, [i])
        elif here and self._dynamics.inverters.forming[i] and not self._fed(i):
            for j in here:
                recovery.unlock(j)
            recovery.await_others(i)
            self._joining.add(i)
            self._tell(step, "trip", name, f"{name} is to start its island, with what has tripped there")
        elif recovery.tripped[i]:
            recovery.unlock(i)
        else:
            self._dynamics.switch_inverter(i, True)
            self._tell(step, "inverter", name, f"{name} connected, at no load")
            self._settle(step, [i])

    def watch(self, step: int, out: NDArray[np.float64]) -> None:
        """Trip who is beyond its settings after these steps, and bring back who may come.

        Parameters
        ----------
        step
            Where the plant stands; what is done acts from the next step on.
        out
            Readings of the steps since the last call, of `Dynamics.run`.
        """
        reduction = self._dynamics.network.reduction
        f, V_low, V_high = out[:, :, 0], out[:, :, 4] / self._V_nom, out[:, :, 5] / self._V_nom
        trips = self._relays.watch(f, V_low, V_high, reduction.online)
        if self._recovery.tripped.any():
            leader = reduction.leader[reduction.inverter_island]
            f = np.where(leader >= 0, f[:, leader], self._dynamics.inverters.f_nom)
        self._recovery.watch(f, V_low, V_high, ~reduction.live[reduction.inverter_island])
        if trips:
            off = [trip.inverter for trip in trips]
            self._dynamics.switch_inverters(off, False)
            for trip in trips:
                name = self._names[trip.inverter]
                self._tell(step, "trip", name, f"{name} tripped: {trip}")
            self.note_trips(step, off)
            self._settle(step, off)
        for group, black in self._returning():
            for i in group:
                self._recovery.enter(i)
            names = ", ".join(self._names[i] for i in group)
            text = f"black start by {names}" if black else f"{names} back in service, at no load"
            self._tell(step, "trip", self._names[group[0]], text)
            for i in sorted(self._joining.intersection(group)):
                self._tell(step, "inverter", self._names[i], f"{self._names[i]} connected, at no load")
            self._joining.difference_update(group)
            self._dynamics.switch_inverters(group, True)
            self._settle(step, group)

    def note_trips(self, step: int, which: list[int], before: int = 0) -> None:
        """Note that inverters have tripped at a step, `before` steps after the last `watch`.

        They hold no load until they are back, whatever they are told.
        """
        locked = [self._names[i] for i in which if self._recovery.trip(i, before)]
        self._dynamics.inverters.set_points[which] = 0.0, 1.0, 0.0
        if locked:
            text = f"{', '.join(locked)}: tripped {ATTEMPTS} times, off until the agent joins anew, or a GFM comes"
            self._tell(step, "trip", locked[0], text)

    def _with(self, i: int) -> NDArray[np.bool_]:
        """Inverters in the same island, that one included."""
        island = self._dynamics.network.reduction.inverter_island
        same: NDArray[np.bool_] = island == island[i]
        return same

    def _fed(self, i: int) -> bool:
        """Whether something feeds an inverter's island."""
        reduction = self._dynamics.network.reduction
        return bool(reduction.live[reduction.inverter_island[i]])

    def _returning(self) -> list[tuple[list[int], bool]]:
        """Tripped inverters that come back now, by island, and whether that is a black start."""
        recovery, forming = self._recovery, self._dynamics.inverters.forming
        island = self._dynamics.network.reduction.inverter_island
        groups = []
        for k in np.unique(island[recovery.tripped]).tolist():
            here = np.flatnonzero(recovery.tripped & ~recovery.locked & (island == k)).tolist()
            ready = [i for i in here if recovery.passed(i)]
            if ready and self._fed(ready[0]):
                groups.append((ready, False))
            elif len(ready) == len(here) and forming[ready].any():  # one of them alone would take the whole load
                groups.append((ready, True))
        return groups
