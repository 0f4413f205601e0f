"""Events of islands: their inverters, dead buses, neutrals, and trips of those without a solution."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from gridpeers.plant.dynamics import Dynamics, PlantError, Trip
from gridpeers.plant.dynamics.reduction import Reduction
from gridpeers.plant.feeder.synchronism import Difference
from gridpeers.plant.known_names import SUBSTATION
from gridpeers.plant.network import Network
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.wording import counted

GRID = "grid"  # name of the island that the substation feeds


class Islands:
    def __init__(self, network: Network) -> None:
        self._network = network
        self._inverters = tuple(unit.name for unit in network.inverters)
        self._dead: list[str] = []
        self._named: tuple[Reduction, tuple[list[str], list[bool]]] | None = None  # the last `names`
        self._reported: dict[str, str] = {}  # last reported text of each island

    def change_loads(self, network: Network) -> None:
        self._network = network

    def names(self, reduction: Reduction) -> tuple[list[str], list[bool]]:
        """Return each inverter's island (`GRID`, or the first inverter's name) and whether the substation feeds it."""
        if self._named is None or self._named[0] is not reduction:
            label = reduction.inverter_island.tolist()
            fed = [bool(reduction.has_source[k]) for k in label]
            first: dict[int, str] = {}
            for k, name, sourced in zip(label, self._inverters, fed, strict=True):
                first.setdefault(k, GRID if sourced else name)
            self._named = reduction, ([first[k] for k in label], fed)
        return self._named[1]

    def report(self, t: float, closed: frozenset[str], reduction: Reduction) -> list[PlantEvent]:
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

    def report_dead(self, t: float, closed: frozenset[str], reduction: Reduction) -> list[PlantEvent]:
        """Return the event at t (s) of newly de-energised buses, with their inverters and loads."""
        network, before = self._network, set(self._dead)
        alive = reduction.live[reduction.label][network.merge(closed).representative]
        fed = {bus for (bus, _), on in zip(network.nodes, alive.tolist(), strict=True) if on}
        self._dead = [bus.name for bus in network.feeder.buses if bus.name not in fed]
        new = [bus for bus in self._dead if bus not in before]
        if not new:
            return []
        dead = set(new)
        lost = sum(S.real for bus, _, S in network.feeder.demands() if bus in dead) / 1e3
        some = ", ".join(new[:6]) + (", ..." if len(new) > 6 else "")
        idle = [unit.name for unit in network.inverters if unit.bus in new]
        count = counted(len(new), "bus", "buses")
        text = f"de-energised: {count} ({some}) without substation or GFM, {lost:.0f} kW of load not served"
        text += f", {', '.join(idle)} idle" if idle else ""
        return [PlantEvent(t=t, kind="dead", subject=new[0], text=text)]


class NeutralEvents:
    """Report the neutrals of a feeder when its network has changed; each once, until it is as before."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._nodes = np.array([network.index(*node) for node in network.neutrals.items()], np.int64)
        self._reported: set[str] = set()

    def report(self, t: float, closed: frozenset[str], dynamics: Dynamics) -> list[PlantEvent]:
        if not self._nodes.size:
            return []
        events = []
        for i in sorted(dynamics.network.reduction.earthing):
            row = self._network.inverters[i]
            text = f"{row.name} earths its neutral, node {row.neutral} of bus {row.bus}: nothing else does"
            events.append(PlantEvent(t=t, kind="island", subject=row.name, text=text))
        for i in self._tied_alone(closed, dynamics):
            name = self._network.inverters[i].name
            text = f"{name}: the neutral alone ties its part to the grid, so it counts as fed by the grid; "
            text += "let the switch open the neutral, too"
            events.append(PlantEvent(t=t, kind="warning", subject=name, text=text))
        before, self._reported = self._reported, {event.text for event in events}
        return [event for event in events if event.text not in before]

    def _tied_alone(self, closed: frozenset[str], dynamics: Dynamics) -> list[int]:
        """Return the grid-forming inverters that nothing but a neutral connects with the substation."""
        network, reduction = self._network, dynamics.network.reduction
        forming = np.flatnonzero(dynamics.inverters.forming & reduction.online)
        forming = forming[reduction.has_source[reduction.inverter_island[forming]]]
        if not forming.size:
            return []
        merge = network.merge(closed)
        keep = np.ones(len(network.nodes))
        keep[merge.representative[self._nodes]] = 0.0
        phases = sp.diags_array(keep)
        _, label = connected_components(phases @ abs(network.admittance(closed)) @ phases, directed=False)
        first = [merge.representative[network.index(*network.inverters[i].node)] for i in forming.tolist()]
        alone = ~np.isin(label[first], label[network.source_nodes])
        return [int(i) for i in forming[alone]]


RECENT = 1.0  # time (s) after a closing out of phase within which a collapse counts as its effect
BEYOND = 10.0  # voltage (pu) that no network has: where there is no solution, it says nothing


def raise_for_trip(events: Iterable[PlantEvent]) -> None:
    """Raise PlantError if a trip is among these events, for callers that need a plant without trips."""
    for event in events:
        if event.kind == "trip":
            raise PlantError(f"at t = {event.t:g} s {event.text}")


def trip_event(
    t: float, trip: Trip, network: Network, closed: frozenset[str], joined: Iterable[tuple[float, Difference]]
) -> PlantEvent:
    """Return the event of a trip: the tripped units, and the cause (overload, collapse or closing out of phase).

    `joined`: closings of switches that joined live islands before, each with its time (s).
    """
    names = [network.inverters[i].name for i in trip.inverters]
    buses = {network.inverters[i].bus for i in trip.inverters}
    if trip.substation:
        names.append(SUBSTATION)
        source = network.feeder.source
        buses |= {source.bus} if source else set()
    own = [island for island in network.islands(closed) if island & buses]
    load = sum(S.real for bus, _, S in network.feeder.demands() if any(bus in of for of in own))
    rating = sum(network.inverters[i].P_rated for i in trip.inverters)
    fed = network.feeder.source is not None and any(network.feeder.source.bus in of for of in own)
    culprit = next(
        (
            (at, closing)
            for at, closing in joined
            if closing.angle > closing.limits.angle
            and t - at <= RECENT
            and any(network.switches[closing.switch].from_bus in of for of in own)
        ),
        None,
    )
    if culprit is not None:
        at, closing = culprit
        switch = network.switches[closing.switch].event_name
        cause = f"closed out of phase, {closing.angle:.0f} deg across {switch} at t = {at:.3f} s"
    elif load > rating and not fed:
        cause = f"overload, {load / 1e3:.0f} kW of load on inverters of {rating / 1e3:.0f} kVA"
    elif load < 0.0:
        cause = f"constant generation of {-load / 1e3:.0f} kW more than the load"
    else:
        cause = f"voltage collapse under {load / 1e3:.0f} kW of load"
    lowest = f"; lowest terminal voltage {trip.V_min:.2f} pu" if trip.inverters and trip.V_min < BEYOND else ""
    text = f"{', '.join(names)} tripped, as the island has no solution: {cause}{lowest}"
    return PlantEvent(t=t, kind="trip", subject=names[0], text=text)
