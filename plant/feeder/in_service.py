"""Inverters in service: trips, returns, and the effect of agents that join and leave."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.dynamics.kernel.compiled import Flags, Real
from gridpeers.plant.feeder.protection import ATTEMPTS, Recovery, Relays
from gridpeers.plant.plant_config import Protection

Tell = Callable[[int, Literal["inverter", "trip"], str, str], None]  # takes an event: step, kind, subject, text

Settle = Callable[[int, list[int]], None]  # called after inverters were switched at a step


class InService:
    """Connect and disconnect the inverters of a feeder, by agents, protection and the network.

    A tripped inverter returns when voltage and frequency at its terminals have been normal for the delay; in a
    de-energised island all return at once, when the last of them has waited as long: a black start, which needs a GFM.
    An inverter that trips repeatedly stays off.
    """

    def __init__(
        self,
        settings: Protection,
        names: tuple[str, ...],
        V_nom: Real,
        dynamics: Dynamics,
        connected: list[bool],
        tell: Tell,
        settle: Settle,
    ) -> None:
        self._names, self._V_nom, self._dynamics = names, V_nom, dynamics
        self._tell, self._settle = tell, settle
        self._connected = np.array(connected)  # inverters with an agent, or without need of one
        self._joining: set[int] = set()  # inverters that wait for others to start their island
        self._relays = Relays(settings, len(names), dynamics.h, dynamics.inverters.f_nom)
        self._recovery = Recovery(settings.enter_service, len(names), dynamics.h, dynamics.inverters.f_nom)

    def has_tripped(self, i: int) -> bool:
        return bool(self._recovery.tripped.item(i))

    @property
    def quiet(self) -> int:
        """Number of steps within which no inverter trips or returns."""
        return min(self._relays.quiet, self._recovery.quiet)

    def connect(self, i: int, step: int, *, on: bool) -> None:
        """Connect an inverter, at zero current and in step with the network, or disconnect it, for its agent.

        A tripped inverter waits until it may return. A GFM that joins a de-energised island with tripped inverters
        starts it together with them, as soon as they have waited long enough.
        """
        name, recovery = self._names[i], self._recovery
        if bool(self._connected[i]) == on and not (on and recovery.tripped[i]):
            return
        self._connected[i] = on
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
            self._tell(step, "trip", name, f"{name} starts its island, together with the inverters that have tripped")
        elif recovery.tripped[i]:
            recovery.unlock(i)
        else:
            self._dynamics.switch_inverter(i, True)
            self._tell(step, "inverter", name, f"{name} connected, at no load")
            self._settle(step, [i])

    def watch(self, step: int, out: Real) -> None:
        """Trip inverters beyond their settings after these steps, and bring back those that may return.

        Changes act from the next step on. `out`: readings of the steps since the last call, of `Dynamics.run`.
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
        """Note trips at a step, `before` steps after the last `watch`; these inverters hold no load until they return."""
        locked = [self._names[i] for i in which if self._recovery.trip(i, before)]
        self._dynamics.inverters.set_points[which] = 0.0, 1.0, 0.0
        if locked:
            text = f"{', '.join(locked)}: tripped {ATTEMPTS} times, off until the agent joins again, or a GFM joins"
            self._tell(step, "trip", locked[0], text)

    def _with(self, i: int) -> Flags:
        island = self._dynamics.network.reduction.inverter_island
        same: Flags = island == island[i]
        return same

    def _fed(self, i: int) -> bool:
        reduction = self._dynamics.network.reduction
        return bool(reduction.live[reduction.inverter_island[i]])

    def _returning(self) -> list[tuple[list[int], bool]]:
        """Return the tripped inverters that return now, by island, and whether that is a black start."""
        recovery, forming = self._recovery, self._dynamics.inverters.forming
        if not recovery.tripped.any():
            return []
        island = self._dynamics.network.reduction.inverter_island
        groups: list[tuple[list[int], bool]] = []
        for k in np.unique(island[recovery.tripped]).tolist():
            here = np.flatnonzero(recovery.tripped & ~recovery.locked & (island == k)).tolist()
            ready = [i for i in here if recovery.passed(i)]
            if ready and self._fed(ready[0]):
                groups.append((ready, False))
            elif len(ready) == len(here) and forming[ready].any():  # one of them alone would take the whole load
                groups.append((ready, True))
        return groups
