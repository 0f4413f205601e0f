"""Protection of inverters: trips, and the return to service. Pure.

IEEE 1547-2018: clauses 6.4.1 (voltage) and 6.5.1 (frequency) with their default settings, and 4.10 (entering service).
For undervoltage the lowest phase of the terminal counts, for overvoltage the highest; the frequency is the inverter's
own. A function trips when its condition has held at every step of its clearing time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
