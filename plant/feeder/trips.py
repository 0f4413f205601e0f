"""The event of an island that is de-energised because its network has no solution: the tripped units and the cause."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from gridpeers.plant.dynamics import PlantError, Trip
from gridpeers.plant.network import Network
from gridpeers.plant.trip_settings import SUBSTATION
from gridpeers.wire.messages import PlantEvent

RECENT = 1.0
"""Time (s) after a closing out of phase within which a collapse counts as its effect."""

BEYOND = 10.0
"""Voltage (pu) that no network has: where there is no solution, it says nothing."""


class Closing(NamedTuple):
    """A switch that has joined two live islands."""

    t: float
    """Time (s)."""
    switch: str
    """Its name."""
    angle: float
    """Angle between the two sides before (deg, 0 to 180)."""
    in_phase: bool
    """Whether the angle was within the window of a synchronism check."""


def raise_for_trip(events: Iterable[PlantEvent]) -> None:
    """Raise PlantError if a trip is among these events, for callers that need a plant without trips."""
    for event in events:
        if event.kind == "trip":
            raise PlantError(f"at t = {event.t:g} s {event.text}")


def trip_event(
    t: float, trip: Trip, network: Network, closed: frozenset[str], closings: Iterable[Closing]
) -> PlantEvent:
    """Return the event of a trip: the tripped units, and the cause (overload, collapse or closing out of phase).

    Parameters
    ----------
    t
        Time (s).
    trip
        Disconnected units.
    network
        The feeder's network.
    closed
        Switches closed at that time.
    closings
        Earlier closings that joined live islands.
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
            closing
            for closing in closings
            if not closing.in_phase
            and t - closing.t <= RECENT
            and any(network.switches[closing.switch].from_bus in of for of in own)
        ),
        None,
    )
    if culprit is not None:
        switch = network.switches[culprit.switch].event_name
        cause = f"closed out of phase, {culprit.angle:.0f} deg across {switch} at t = {culprit.t:.3f} s"
    elif load > rating and not fed:
        cause = f"overload, {load / 1e3:.0f} kW of load on inverters of {rating / 1e3:.0f} kVA"
    elif load < 0.0:
        cause = f"constant generation of {-load / 1e3:.0f} kW more than the load"
    else:
        cause = f"voltage collapse under {load / 1e3:.0f} kW of load"
    lowest = f"; lowest terminal voltage {trip.V_min:.2f} pu" if trip.inverters and trip.V_min < BEYOND else ""
    text = f"{', '.join(names)} tripped, as the island has no solution: {cause}{lowest}"
    return PlantEvent(t=t, kind="trip", subject=names[0], text=text)
