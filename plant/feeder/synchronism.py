"""Switches that join live islands: the differences across them, and the closings that wait for synchronism.

The limits are those of IEEE Std 1547-2018, Table 5, by the aggregate rating of the energized system's units.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import compress
from math import degrees
from typing import NamedTuple

import numpy as np

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.dynamics.kernel.compiled import Flags
from gridpeers.plant.feeder.switchboard import Switchboard
from gridpeers.plant.known_names import F_BASE
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import SyncCheck
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.timing import time_of

_TABLE_5 = ((500e3, 0.3, 0.10, 20.0), (1500e3, 0.2, 0.05, 15.0), (np.inf, 0.1, 0.03, 10.0))
"""Rating (VA) up to which these limits hold: Hz, pu, deg."""


LOCKED = 0.01  # difference of frequency (Hz) below which two islands count as held at one frequency
LEAST = 0.1  # voltage without load (pu) below which a pole of a switch is a neutral's


class SynchronizationLimits(NamedTuple):
    """Largest differences at which a switch may close."""

    angle: float
    f: float
    V: float

    def __str__(self) -> str:
        return f"at most {self.angle:g} deg, {self.f:g} Hz and {100.0 * self.V:g} %"


class Difference(NamedTuple):
    """Difference across an open switch between two separate live islands."""

    switch: str
    angle: float  # largest angle between equal phases (deg), 0 to 180
    f: float  # difference of frequency (Hz)
    V: float  # largest difference of voltage of equal phases (pu of nominal)
    limits: SynchronizationLimits

    @property
    def within(self) -> bool:
        return self.angle <= self.limits.angle and self.f <= self.limits.f and self.V <= self.limits.V

    @property
    def way_out(self) -> str:
        """Advice that brings the two sides within the limits."""
        if self.f > self.limits.f or self.V > self.limits.V:
            return "try again when frequencies and voltages have come closer"
        if self.f < LOCKED:
            return "at equal frequencies the angle stays: change the load or the set-points of one side"
        return f"try again: the angle passes through zero every {1.0 / self.f:.2g} s"

    def __str__(self) -> str:
        return f"{self.angle:.1f} deg, {self.f:.3f} Hz and {100.0 * self.V:.1f} % of voltage apart"


def limits_for(rating: float, check: SyncCheck, f_nom: float = F_BASE) -> SynchronizationLimits:
    """Return the limits of Table 5 for an aggregate rating (VA); limits set in `check` replace them.

    The standard's frequencies are for 60 Hz; at another nominal frequency (Hz) they are in proportion.

    >>> str(limits_for(1.3e6, SyncCheck())), str(limits_for(3.9e6, SyncCheck(angle=5.0)))
    ('at most 15 deg, 0.2 Hz and 5 %', 'at most 5 deg, 0.1 Hz and 3 %')
    """
    f, V, angle = next(row[1:] for row in _TABLE_5 if rating <= row[0])
    return SynchronizationLimits(check.angle or angle, check.f or f * (f_nom / F_BASE), check.V or V)


class Closings:
    """Measure the differences across open switches, and judge their closings, which may wait for synchronism.

    `joined`: the latest closings that have joined live islands, each with its time (s).
    """

    def __init__(self, switches: Switchboard, network: Network, dynamics: Dynamics, check: SyncCheck, h: float) -> None:
        self._switches, self._network, self._dynamics, self._check = switches, network, dynamics, check
        self._timeout, self._h = round(check.timeout / h), h
        self._waiting: dict[str, int] = {}  # by switch, the step of its scheduled closing
        self.joined: deque[tuple[float, Difference]] = deque(maxlen=20)

    def difference(self, name: str) -> Difference | None:
        return self._across(name, self._switches.closed)

    def refusal(self, name: str) -> str:
        """Return why a switch (by its name) may not close now under a synchronism check; "" if it may."""
        difference = self.difference(name)
        if difference is None or difference.within:
            return ""
        return (
            f"switch {self._switches.switch(name).full_name} not closed: its sides are {difference}; allowed are "
            f"{difference.limits}; {difference.way_out}, or close it without the check"
        )

    def check_waiting(self, step: int) -> list[PlantEvent]:
        """Close the waiting switches that are in step now; return the events of those that give up."""
        events = []
        for name, since in list(self._waiting.items()):
            difference = self._across(name, self._switches.closed)
            if difference is None or difference.within:
                del self._waiting[name]
                self._switches.put(step, name, "close", synchronised=True)
            elif step >= since + self._timeout:
                del self._waiting[name]
                waited = (step - since) * self._h
                text = f"not closed: not in step within {waited:g} s, now {difference}; allowed are {difference.limits}"
                events.append(self._warning(step, name, text))
        return events

    def judge(self, step: int) -> tuple[dict[str, str], list[PlantEvent]]:
        """Hold back closings that must wait, among the operations of a step; return notes by switch, and events."""
        closed = self._switches.closed
        due = self._switches.due(step)
        closing = [operation.switch for operation in due if operation.action == "close"]
        notes: dict[str, str] = {}
        events: list[PlantEvent] = []
        for operation in due:
            name = operation.switch
            self._waiting.pop(name, None)  # a new operation replaces a waiting one
            if operation.action != "close" or name in closed:
                continue
            difference = self._across(name, closed, closing)
            if difference is None:
                continue
            if operation.synchronised and not difference.within:
                self._switches.drop(step, operation)
                self._waiting[name] = step
                text = f"waits for synchronism: its sides are {difference}; allowed are {difference.limits}"
                events.append(self._warning(step, name, text))
            elif operation.synchronised:
                notes[name] = f" in step: {difference}"
                self.joined.append((time_of(step, self._h), difference))
            else:
                events.append(self._warning(step, name, f"joins two live islands: its sides are {difference}"))
                self.joined.append((time_of(step, self._h), difference))
        return notes, events

    def _warning(self, step: int, name: str, text: str) -> PlantEvent:
        switch = self._switches.switch(name)
        text = f"switch {switch.full_name} {text}"
        return PlantEvent(t=time_of(step, self._h), kind="warning", subject=switch.event_name, text=text)

    def _across(self, switch: str, closed: frozenset[str], others: Iterable[str] = ()) -> Difference | None:
        """Return the difference across a switch (by its name) now; None if it does not separate two live islands.

        `others`: switches that close with it. A dead side that one of them energizes counts as the energizing island.
        """
        device = self._network.switches[switch]
        at = [self._network.index(device.from_bus, phase) for phase in device.phases]
        live = np.abs(self._network.nominal[at]) > LEAST * self._network.V_nom[at]
        phases = "".join(compress(device.phases, live))  # a neutral's pole has no voltage to compare
        if not phases:
            return None
        found = self._on_phases(switch, phases, closed, others)
        if found is None and len(phases) > 1:  # a single-phase inverter may feed one phase of a side alone
            single = (self._on_phases(switch, phase, closed, others) for phase in phases)
            found = max(filter(None, single), key=lambda difference: difference.angle, default=None)
        return found

    def _on_phases(self, switch: str, phases: str, closed: frozenset[str], others: Iterable[str]) -> Difference | None:
        """Return the difference across these phases of a switch, whose ends must all be live."""
        network, reduction = self._network, self._dynamics.network.reduction
        device, merge = network.switches[switch], network.merge(closed)
        island = reduction.label[merge.representative]
        live = reduction.live[island]
        rest = closed.union(others) - {switch}
        ends = [self._live_end(bus, phases, live, rest) for bus in (device.from_bus, device.to_bus)]
        nodes = [[network.index(bus, phase) for phase in phases] for bus in ends if bus]
        if len(nodes) < 2 or island[nodes[0][0]] == island[nodes[1][0]]:
            return None
        first, second = (int(island[of[0]]) for of in nodes)
        V = merge.expand(self._dynamics.voltages())
        a, b = (V[of] / network.nominal[of] for of in nodes)
        rated = [self._rating(first), self._rating(second)]
        f_1, f_2 = self._dynamics.frequency(first), self._dynamics.frequency(second)
        return Difference(
            switch=switch,
            angle=degrees(float(np.max(np.abs(np.angle(a * np.conj(b)))))),
            f=abs(f_1 - f_2),
            V=float(np.max(np.abs(np.abs(a) - np.abs(b)))),
            limits=limits_for(min(rated), self._check, network.feeder.f_nom),
        )

    def _live_end(self, bus: str, phases: str, live: Flags, closed: frozenset[str]) -> str:
        """Return the bus if it is live, else a live bus that these closed switches join to it; "" if there is none."""
        network = self._network
        island = next(buses for buses in network.islands(closed) if bus in buses)
        for name in (bus, *(other.name for other in network.feeder.buses if other.name in island)):
            if network.has(name, phases) and all(live[network.index(name, phase)] for phase in phases):
                return name
        return ""

    def _rating(self, island: int) -> float:
        """Return the rating (VA) of all inverters that feed an island; infinite with the substation."""
        reduction, units = self._dynamics.network.reduction, self._dynamics.inverters
        if reduction.has_source[island]:
            return float("inf")
        return float(units.S_b[reduction.online & (reduction.inverter_island == island)].sum())
