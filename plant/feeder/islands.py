"""Islands by the names of their inverters, and as events of a run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridpeers.plant.dynamics.switch_state import SwitchState
from gridpeers.plant.network import Network
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import counted

GRID = "grid"
"""Name of the island that the substation feeds."""


class Islands:
    """Name a feeder's islands, and report their changes.

    Parameters
    ----------
    network
        The feeder's network.
    """

    def __init__(self, network: Network) -> None:
        self._network = network
        self._inverters = tuple(unit.name for unit in network.inverters)
        self._dead: list[str] = []
        self._named: tuple[SwitchState, tuple[list[str], list[bool]]] | None = None
        """The last switch state, and its `names`."""
        self._reported: dict[str, str] = {}
        """Last reported text of each island."""

    def change_loads(self, network: Network) -> None:
        """Go on with the same network with other loads."""
        self._network = network

    def names(self, reduction: SwitchState) -> tuple[list[str], list[bool]]:
        """Return each inverter's island (`GRID`, or the first inverter's name) and whether the substation feeds it."""
        if self._named is None or self._named[0] is not reduction:
            self._named = reduction, self._names(reduction)
        return self._named[1]

    def _names(self, reduction: SwitchState) -> tuple[list[str], list[bool]]:
        label = reduction.inverter_island.tolist()
        fed = [bool(reduction.has_source[k]) for k in label]
        first: dict[int, str] = {}
        for k, name, sourced in zip(label, self._inverters, fed, strict=True):
            first.setdefault(k, GRID if sourced else name)
        return [first[k] for k in label], fed

    def report(self, t: float, closed: frozenset[str], reduction: SwitchState) -> list[PlantEvent]:
        """Return the events at t (s) of changed islands and newly de-energised buses, with these switches closed."""
        names, _ = self.names(reduction)
        texts = {}
        for name in dict.fromkeys(names):
            members = [
                unit
                for unit, of, online in zip(self._inverters, names, reduction.online, strict=True)
                if of == name and online
            ]
            if members:
                texts[name] = f"{'the grid feeds' if name == GRID else 'island of'} {', '.join(members)}"
        events = [
            PlantEvent(t=t, kind="island", subject=name, text=text)
            for name, text in texts.items()
            if self._reported.get(name) != text
        ]
        self._reported = texts
        return events + self.report_dead(t, closed, reduction)

    def report_dead(self, t: float, closed: frozenset[str], reduction: SwitchState) -> list[PlantEvent]:
        """Return the event at t (s) of newly de-energised buses, with their inverters and loads."""
        before = set(self._dead)
        self._dead = self._dead_buses(closed, reduction.live[reduction.label])
        new = [bus for bus in self._dead if bus not in before]
        if not new:
            return []
        network, dead = self._network, set(new)
        lost = sum(S.real for bus, _, S in network.feeder.demands() if bus in dead) / 1e3
        some = ", ".join(new[:6]) + (", ..." if len(new) > 6 else "")
        idle = [unit.name for unit in network.inverters if unit.bus in new]
        count = counted(len(new), "bus", "buses")
        text = f"de-energised: {count} ({some}) without substation or GFM, {lost:.0f} kW of load not served"
        text += f", {', '.join(idle)} idle" if idle else ""
        return [PlantEvent(t=t, kind="dead", subject=new[0], text=text)]

    def _dead_buses(self, closed: frozenset[str], live: NDArray[np.bool_]) -> list[str]:
        """Return the buses without a live node, in the feeder's order."""
        alive = live[self._network.merge(closed).representative]
        fed = {bus for (bus, _), on in zip(self._network.nodes, alive.tolist(), strict=True) if on}
        return [bus.name for bus in self._network.feeder.buses if bus.name not in fed]
