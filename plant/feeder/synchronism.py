"""Differences of two live islands across an open switch, and the largest at which it may close.

The limits are the synchronization parameter limits of IEEE Std 1547-2018, Table 5: of frequency, voltage and
phase-angle difference for connecting an energized local system, by the aggregate rating of its units.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import compress
from math import degrees

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics import Dynamics
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import SyncCheck
from gridpeers.plant.trip_settings import F_BASE

_TABLE_5 = ((500e3, 0.3, 0.10, 20.0), (1500e3, 0.2, 0.05, 15.0), (np.inf, 0.1, 0.03, 10.0))
"""Rating (VA) up to which these limits hold: frequency (Hz), voltage (pu), angle (deg)."""


LOCKED = 0.01
"""Difference of frequency (Hz) below which two islands count as held at one frequency: a beat lasts 100 s and more."""

LEAST = 0.1
"""Voltage without load (pu) below which a pole of a switch is a neutral's."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """Difference across an open switch between two separate live islands."""

    switch: str
    """Name of the switch."""
    angle: float
    """Largest angle between equal phases (deg), 0 to 180."""
    f: float
    """Difference of frequency (Hz)."""
    V: float
    """Largest difference of voltage of equal phases (pu of nominal)."""
    limits: SynchronizationLimits
    """Limits of these three."""

    @property
    def within(self) -> bool:
        """Whether the two sides may be joined."""
        return self.angle <= self.limits.angle and self.f <= self.limits.f and self.V <= self.limits.V

    @property
    def way_out(self) -> str:
        """Advice that brings the two sides within the limits.

        Examples
        --------
        >>> apart = {"switch": "sw", "V": 0.0, "limits": SynchronizationLimits(angle=10.0, f=0.1, V=0.03)}
        >>> Difference(angle=90.0, f=0.05, **apart).way_out
        'try again: the angle passes through zero every 20 s'
        >>> Difference(angle=90.0, f=0.001, **apart).way_out
        'at equal frequencies the angle stays: change the load or the set-points of one side'
        >>> Difference(angle=3.0, f=0.5, **apart).way_out
        'try again when frequencies and voltages have come closer'
        """
        if self.f > self.limits.f or self.V > self.limits.V:
            return "try again when frequencies and voltages have come closer"
        if self.f < LOCKED:
            return "at equal frequencies the angle stays: change the load or the set-points of one side"
        return f"try again: the angle passes through zero every {1.0 / self.f:.2g} s"

    def __str__(self) -> str:
        return f"{self.angle:.1f} deg, {self.f:.3f} Hz and {100.0 * self.V:.1f} % of voltage apart"


@dataclass(frozen=True, kw_only=True)
class SynchronizationLimits:
    """Largest differences at which a switch may close."""

    angle: float
    """Angle (deg)."""
    f: float
    """Frequency (Hz)."""
    V: float
    """Voltage (pu)."""

    def __str__(self) -> str:
        return f"at most {self.angle:g} deg, {self.f:g} Hz and {100.0 * self.V:g} %"


def limits_for(rating: float, check: SyncCheck, f_nom: float = F_BASE) -> SynchronizationLimits:
    """Return the limits of IEEE 1547-2018, Table 5, for an aggregate rating (VA); limits set in `check` replace them.

    The standard's frequencies are for 60 Hz; at another nominal frequency (Hz) they are in proportion.

    Examples
    --------
    >>> limits_for(1.3e6, SyncCheck())
    SynchronizationLimits(angle=15.0, f=0.2, V=0.05)
    >>> str(limits_for(3.9e6, SyncCheck(angle=5.0)))
    'at most 5 deg, 0.1 Hz and 3 %'
    >>> round(limits_for(3.9e6, SyncCheck(), 50.0).f, 4), limits_for(3.9e6, SyncCheck(f=0.2), 50.0).f
    (0.0833, 0.2)
    """
    f, V, angle = next(row[1:] for row in _TABLE_5 if rating <= row[0])
    return SynchronizationLimits(angle=check.angle or angle, f=check.f or f * (f_nom / F_BASE), V=check.V or V)


class Synchronism:
    """Measure differences across the open switches of a feeder.

    Parameters
    ----------
    network
        The feeder's network.
    dynamics
        Its inverters.
    check
        Limits that replace those of the standard.
    """

    def __init__(self, network: Network, dynamics: Dynamics, check: SyncCheck) -> None:
        self._network, self._dynamics, self._check = network, dynamics, check

    def across(self, switch: str, closed: frozenset[str], others: Iterable[str] = ()) -> Difference | None:
        """Return the difference across a switch (by its name) now; None if it does not separate two live islands.

        Parameters
        ----------
        switch
            Its name.
        closed
            Switches that are closed now.
        others
            Switches that close with it. A dead side that one of them energizes counts as the energizing island.
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

    def _live_end(self, bus: str, phases: str, live: NDArray[np.bool_], closed: frozenset[str]) -> str:
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
