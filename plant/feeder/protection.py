"""Protection of inverters: trips, and the return to service. Pure.

IEEE 1547-2018: clauses 6.4.1 (voltage) and 6.5.1 (frequency) with their default settings, and 4.10 (entering service).
For undervoltage the lowest phase of the terminal counts, for overvoltage the highest; the frequency is the inverter's
own. A function trips when its condition has held at every step of its clearing time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.dynamics.kernel.compiled import Flags, Real
from gridpeers.plant.known_names import F_BASE, defaults
from gridpeers.plant.plant_config import Protection

V_ENTER = (0.917, 1.05)  # voltages (pu) within which an inverter may enter service: IEEE 1547-2018, Table 4
F_ENTER = (59.5, 60.1)  # the same for the frequency (Hz at 60 Hz)
ATTEMPTS = 3  # trips, each within `SETTLED` of the last return, after which an inverter stays off
SETTLED = 60.0  # time in service (s) after which earlier trips do not count

_WORDS = {"OV": "overvoltage", "UV": "undervoltage", "OF": "overfrequency", "UF": "underfrequency"}


class Tripped(NamedTuple):
    inverter: int
    function: str  # name of the function in the standard: "UV2"
    value: float  # last measured value (pu or Hz)
    threshold: float  # its setting (pu or Hz)
    time: float  # time beyond the setting (s): the clearing time

    def __str__(self) -> str:
        unit = "Hz" if self.function[1] == "F" else "pu"
        value = f"{self.value:.2f} {unit}"
        return f"{_WORDS[self.function[:2]]} {value} for {self.time:g} s ({self.function}: {self.threshold:g} {unit})"


class Relays:
    """The trip functions of all inverters."""

    def __init__(self, settings: Protection, n: int, h: float, f_nom: float) -> None:
        chosen = {} if settings.category == "off" else defaults(settings.category, f_nom) | settings.trips
        self.names = tuple(chosen)
        self.thresholds = np.array([value for value, _ in chosen.values()])
        self.times = np.array([time for _, time in chosen.values()])
        self._need = np.maximum(1, np.round(self.times / h)).astype(np.int64)
        self._of = np.array([0 if name[1] == "F" else 2 if name[0] == "O" else 1 for name in chosen], np.int64)
        """Quantity of each function: f, V_low or V_high."""
        self._sign = np.array([1.0 if name[0] == "O" else -1.0 for name in chosen])
        self._count = np.zeros((n, len(chosen)), np.int64)  # steps for which each function's condition has held
        self._shortest = int(np.min(self._need, initial=2**31))
        self._counting = False  # whether any condition has held at the last step
        highest, lowest = np.full(3, np.inf), np.full(3, -np.inf)
        for of, sign, threshold in zip(self._of, self._sign, self.thresholds, strict=True):
            if sign > 0.0:
                highest[of] = min(highest[of], threshold)
            else:
                lowest[of] = max(lowest[of], threshold)
        self._usual = tuple(zip(lowest.tolist(), highest.tolist(), strict=True))
        """Range within which no function's condition holds, of each quantity."""

    @property
    def quiet(self) -> int:
        """Number of steps within which no function can trip."""
        return int(np.min(self._need - self._count, initial=2**31)) if self._counting else self._shortest

    def watch(self, f: Real, V_low: Real, V_high: Real, on: Flags) -> list[Tripped]:
        """Take the readings since the last call, at most `quiet` of them; inverters that are not `on` do not trip.

        `f`, `V_low`, `V_high`: Hz, and voltage of the lowest and the highest phase (pu), steps x inverters.
        """
        if not self.names:
            return []
        readings = zip((f, V_low, V_high), self._usual, strict=True)
        if all(low <= float(of.min()) and float(of.max()) <= high for of, (low, high) in readings):
            if self._counting:
                self._count[:], self._counting = 0, False
            return []
        measured = np.stack([f, V_low, V_high], axis=2)[:, :, self._of]
        beyond = (self._sign * (measured - self.thresholds) > 0.0) & on[:, None]
        self._counting = bool(beyond.any())
        if not self._counting:
            self._count[:] = 0
            return []
        for row in beyond:
            self._count = np.where(row, self._count + 1, 0)
        trips: dict[int, Tripped] = {}
        for i, k in np.argwhere(self._count >= self._need).tolist():
            value, threshold, time = measured[-1, i, k], self.thresholds[k], self.times[k]
            trips.setdefault(i, Tripped(i, self.names[k], float(value), float(threshold), float(time)))
        self._count[list(trips)] = 0
        return list(trips.values())


class Recovery:
    """Tripped inverters, and their return to service.

    `delay`: time (s) for which voltage and frequency must have been normal at the terminals; `locked`: inverters that
    have tripped too often, which do not return by themselves.
    """

    def __init__(self, delay: float, n: int, h: float, f_nom: float) -> None:
        self.tripped, self.locked = np.zeros(n, bool), np.zeros(n, bool)
        self._need, self._settled = max(1, round(delay / h)), round(SETTLED / h)
        self._f_band = F_ENTER[0] * f_nom / F_BASE, F_ENTER[1] * f_nom / F_BASE
        self._waited, self._served = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._trips = np.zeros(n, np.int64)
        self._was_dead = np.zeros(n, bool)

    def trip(self, i: int, before: int = 0) -> bool:
        """Note a trip, `before` steps after the last `watch`; return whether the inverter has tripped too often."""
        self._trips[i] = 1 if self._served[i] >= self._settled else self._trips[i] + 1
        self.tripped[i], self._waited[i], self._served[i] = True, -before, 0
        self.locked[i] = self._trips[i] >= ATTEMPTS
        return bool(self.locked[i])

    def enter(self, i: int) -> None:
        self.tripped[i] = self.locked[i] = False
        self._served[i] = 0

    def forget(self, i: int) -> None:
        self.enter(i)
        self._trips[i] = 0

    def unlock(self, i: int) -> None:
        """Let an inverter return that has tripped too often, because its agent joins again."""
        self.locked[i], self._trips[i] = False, 0

    def await_others(self, i: int) -> None:
        """Let a joining inverter, which need not wait itself, wait for the tripped ones."""
        self.tripped[i], self._waited[i] = True, self._need
        self.unlock(i)

    def passed(self, i: int) -> bool:
        return bool(self._waited[i] >= self._need)

    @property
    def quiet(self) -> int:
        """Number of steps within which no delay ends."""
        if not self.tripped.any():
            return 2**31
        waits = (self._need - self._waited)[self.tripped & ~self.locked]
        return int(np.min(waits[waits > 0], initial=2**31))

    def watch(self, f: Real, V_low: Real, V_high: Real, dead: Flags) -> None:
        """Take the readings since the last call, as `Relays.watch`, with f of the island.

        `dead`: inverters in a de-energised island, where the delay counts from the trip.
        """
        steps = len(f)
        if not self.tripped.any():
            self._served += steps
            return
        self._served = np.where(self.tripped, 0, self._served + steps)
        normal = (V_low >= V_ENTER[0]) & (V_high <= V_ENTER[1]) & (f >= self._f_band[0]) & (f <= self._f_band[1])
        normal |= dead
        since_last = np.where(normal.all(axis=0), steps, np.argmin(normal[::-1], axis=0))
        waited = np.where(normal.all(axis=0), self._waited + steps, since_last)
        waited = np.where(dead == self._was_dead, waited, np.minimum(waited, since_last))
        self._waited = np.where(self.tripped, waited, 0)
        self._was_dead = dead.copy()


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
            self._dynamics.switch_inverters([i], False)
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
            self._dynamics.switch_inverters([i], True)
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
        """Note trips at a step, `before` steps after the last `watch`; the inverters hold no load until they return."""
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
