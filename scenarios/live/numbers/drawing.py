"""What the figures of a run by hand share: the whole run, with all that people did in it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import msgspec

from plant.equipment import Feeder
from scenarios.live.numbers.departures import Compared
from scenarios.results.drawing import Drawing, Mark, drawing_of
from scenarios.results.history import History
from scenarios.results.islands import taken_part
from scenarios.results.moves import as_they_came
from scenarios.spec import Scenario
from wire.messages import PlantEvent


def drawing_by_hand(
    compared: Compared, scenario: Scenario, feeder: Feeder, case: str, history: History, events: Sequence[PlantEvent]
) -> Drawing:
    """Return what to draw: all events by name, and a line where people departed otherwise from the scenario.

    Parameters
    ----------
    compared : Compared
        The run beside its scenario.
    scenario, feeder : Scenario, Feeder
        What was to be run.
    case : str
        Name of the case.
    history : History
        The record.
    events : Sequence[PlantEvent]
        What the plant told.
    """
    reached = tuple(event for event in scenario.events if event.t_s < compared.ended)
    came = as_they_came(msgspec.structs.replace(scenario, events=reached), events)
    taken, plates = taken_part(scenario, feeder, history)
    drawing = drawing_of(compared.happened, feeder, plates, {case: taken}, came)
    marks = [*drawing.events, *_by_hand(compared.departures)]
    return replace(drawing, events=marks, moves=any(event.kind == "inverter" for event in events))


def _by_hand(departures: Iterable[PlantEvent]) -> Iterator[Mark]:
    """Marks of what people did: the switches of one moment have one, with words; what else there is, a line alone."""
    by_time: dict[float, list[str]] = {}
    for event in departures:
        if event.t > 0.0:
            switched = re.fullmatch(r"switch (\S+)(?: \(.*\))? (open|close)d", event.text)
            by_time.setdefault(event.t, []).extend([f"{switched[1]} {switched[2]}s"] if switched else [])
    yield from (Mark("by hand" if what else "", t, ", ".join(what)) for t, what in by_time.items())
