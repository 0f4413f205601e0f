"""What the events of a run say: inverters that are off as they tripped, and laws or graphs of a user that failed."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

from gridpeers.agents.graphs import natural_order
from gridpeers.plant.known_names import SUBSTATION
from gridpeers.plant.plant_config import OnLawFailure
from gridpeers.plant.plant_stepper import IDLE
from gridpeers.wire.messages import PlantEvent


class LawFailure(NamedTuple):
    t: float
    agent: str
    why: str

    @property
    def sentence(self) -> str:
        return f"{self.agent} at t = {self.t:.2f} s: {self.why}"


def law_failures(events: Iterable[PlantEvent]) -> tuple[LawFailure, ...]:
    found = []
    for event in events:
        if event.kind == "law":
            why = event.text.removeprefix(f"{event.subject}: ").removesuffix(IDLE)
            found.append(LawFailure(event.t, event.subject, why))
    return tuple(sorted(found, key=lambda failure: (failure.t, natural_order(failure.agent))))


def ended_by_a_law(on_law_failure: OnLawFailure, events: Iterable[PlantEvent]) -> bool:
    return on_law_failure == "stop" and any(event.kind == "law" for event in events)


def first_of(failures: tuple[LawFailure, ...]) -> str:
    """Return the first failure on one line, and how many more there are; empty without any."""
    more = f"; and {len(failures) - 1} more" if len(failures) > 1 else ""
    return failures[0].sentence + more if failures else ""


_NAMES = r"(?P<names>[^\s,:]+(?:, [^\s,:]+)*)"
_TRIPS = re.compile(f"{_NAMES} tripped")
_RETURNS = re.compile(f"(?:black start by )?{_NAMES}(?:$| back in service)")


def tripped_by(event: PlantEvent) -> tuple[str, ...]:
    """Return the inverters that trip by an event, without a substation that trips with them; else none."""
    found = _TRIPS.match(event.text) if event.kind == "trip" else None
    return tuple(name for name in found["names"].split(", ") if name != SUBSTATION) if found else ()


def tripped_inverters(events: Iterable[PlantEvent]) -> dict[str, PlantEvent]:
    """Return the inverters that are off because they tripped, each with the event of its last trip.

    An inverter whose agent has it leave, or join, is no longer one of them. One that joins a dead island, and waits
    there for those that have tripped, has not tripped itself.
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
