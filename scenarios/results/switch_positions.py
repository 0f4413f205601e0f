"""The switches that are closed after some events of a run: as the plant recorded them, not as a scenario plans them."""

from __future__ import annotations

from collections.abc import Iterable

from plant.equipment import Feeder
from plant.equipment.bus_islands import switch_name
from scenarios.schema.scenario_model import ScenarioModel
from wire.messages import PlantEvent


def switch_events(scenario: ScenarioModel, feeder: Feeder, recorded: Iterable[PlantEvent]) -> tuple[PlantEvent, ...]:
    """Return the operations of switches that a plant recorded.

    A federation's plant need not tell of any: then they are those that the scenario asks of it.
    """
    told = tuple(event for event in recorded if event.kind == "switch")
    if told or scenario.plant.simulator != "helics":
        return told
    return tuple(
        PlantEvent(t=event.t_s, kind="switch", subject=switch_name(feeder, name), text="as planned", closed=closed)
        for event in scenario.events
        for names, closed in ((event.open, False), (event.close, True))
        for name in names
    )


def closed_switches(feeder: Feeder, events: Iterable[PlantEvent]) -> frozenset[str]:
    """Return the names of the switches that are closed after some events, from those that are closed at the start.

    A switch that waits for synchronism has no event of kind "switch" until it closes.

    Parameters
    ----------
    feeder : Feeder
        Its tables.
    events : Iterable[PlantEvent]
        `switch_events` up to some time, in the order of time.
    """
    names = {each: switch.name for switch in feeder.switches for each in (*switch.names, switch.event_name)}
    closed = {switch.name for switch in feeder.switches if switch.closed}
    for event in events:
        if event.subject not in names:
            continue  # an outside plant may have others
        if _is_closed(event):
            closed.add(names[event.subject])
        else:
            closed.discard(names[event.subject])
    return frozenset(closed)


def _is_closed(event: PlantEvent) -> bool:
    """Return the position of a switch from its event on; of a table of events, by its words."""
    return " closed" in event.text if event.closed is None else event.closed
