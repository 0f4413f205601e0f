"""The inverters that are off after some events of a run because they tripped, by the words of the plant's events."""

from __future__ import annotations

import re
from collections.abc import Iterable

from gridpeers.plant.trip_settings import SUBSTATION
from gridpeers.wire.messages import PlantEvent

_NAMES = r"(?P<names>[^\s,:]+(?:, [^\s,:]+)*)"
_TRIPS = re.compile(f"{_NAMES} tripped")
_RETURNS = re.compile(f"(?:black start by )?{_NAMES}(?:$| back in service)")


def tripped_by(event: PlantEvent) -> tuple[str, ...]:
    """Return the inverters that trip by an event, without a substation that trips with them.

    None do by an event of another kind, or by one that tells of returns.

    Examples
    --------
    >>> texts = ("inv1, inv2 tripped, as the island", "inv1: tripped 3 times, off until", "inv1 back in service, at no")
    >>> [tripped_by(PlantEvent(t=1.0, kind="trip", subject="inv1", text=text)) for text in texts]
    [('inv1', 'inv2'), (), ()]
    >>> tripped_by(PlantEvent(t=1.0, kind="trip", subject="inv1", text="inv1, substation tripped, as the island"))
    ('inv1',)
    """
    found = _TRIPS.match(event.text) if event.kind == "trip" else None
    return tuple(name for name in found["names"].split(", ") if name != SUBSTATION) if found else ()


def tripped_inverters(events: Iterable[PlantEvent]) -> dict[str, PlantEvent]:
    """Return the inverters that are off because they tripped, each with the event of its last trip.

    An inverter whose agent has it leave, or join, is no longer one of them. One that joins a dead island, and waits
    there for those that have tripped, has not tripped itself.

    Parameters
    ----------
    events : Iterable[PlantEvent]
        Events of the plant up to some time, in the order of time.
    """
    off: dict[str, PlantEvent] = {}
    for event in events:
        if event.kind == "inverter":
            off.pop(event.subject, None)
        elif names := tripped_by(event):
            off |= dict.fromkeys(names, event)
        elif event.kind == "trip" and (found := _RETURNS.match(event.text)):
            for name in found["names"].split(", "):
                off.pop(name, None)
    return off
