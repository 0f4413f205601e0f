"""The switches that are closed after some events of a run: as the plant recorded them, not as a scenario plans them."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.bus_islands import switch_name, switch_names
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.messages import PlantEvent


def switch_events(scenario: ScenarioModel, feeder: Feeder, recorded: Iterable[PlantEvent]) -> tuple[PlantEvent, ...]:
    """Return the operations of switches that a plant recorded, in the order of time.

    A federation's plant need not record any: then they are those that the scenario plans. Of every other plant, no
    event means no operation; a run folder without its events.csv cannot be read.
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


def closed_switches(
    feeder: Feeder, events: Iterable[PlantEvent], before: Collection[str] | None = None
) -> frozenset[str]:
    """Return the names of the switches that are closed after some events.

    A switch that waits for synchronism has no event of kind "switch" until it closes.

    Parameters
    ----------
    feeder : Feeder
        Its tables.
    events : Iterable[PlantEvent]
        `switch_events` up to some time, in the order of time.
    before : Collection[str], optional
        Names of the switches that are closed before; when left out, those that are closed at the start of a run.
    """
    names = switch_names(feeder)
    closed = {switch.name for switch in feeder.switches if switch.closed} if before is None else set(before)
    for event in events:
        if event.subject not in names:
            continue  # an outside plant may have others
        if is_closed(event):
            closed.add(names[event.subject])
        else:
            closed.discard(names[event.subject])
    return frozenset(closed)


def is_closed(event: PlantEvent) -> bool:
    """Return the position of a switch from its event on; of a table of events, by its words."""
    return " closed" in event.text if event.closed is None else event.closed
