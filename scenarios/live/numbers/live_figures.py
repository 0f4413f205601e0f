"""Data for the figures of a live run: the whole run, with the departures from its scenario."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import msgspec

from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.live.numbers.departures import Departures
from gridpeers.scenarios.results.event_windows import as_they_came
from gridpeers.scenarios.results.history import History
from gridpeers.scenarios.results.island_membership import taken_part
from gridpeers.scenarios.results.plots.drawing import Drawing, Mark, drawing_of
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.wire.messages import PlantEvent

PRESENT = {"opened": "opens", "closed": "closes", "joined": "joins", "left": "leaves", "died": "dies"}
"""Verbs of the plant's events, and the same in figures."""


def live_drawing(
    departures: Departures, scenario: ScenarioModel, feeder: Feeder, history: History, events: Sequence[PlantEvent]
) -> Drawing:
    """Return the data to draw: all events by name, and a line at each departure from the scenario.

    Parameters
    ----------
    departures : Departures
        The run compared with its scenario.
    scenario, feeder : ScenarioModel, Feeder
        As run, with one case.
    history : History
        The recorded rows.
    events : Sequence[PlantEvent]
        The plant's events.
    """
    (case,) = scenario.cases
    reached = tuple(event for event in scenario.events if event.t_s < history.t[-1])
    came = as_they_came(msgspec.structs.replace(scenario, events=reached), events)
    drawing = drawing_of(scenario, feeder, {case: taken_part(scenario, feeder, history)}, {case: events}, came)
    marks = [*drawing.events, *_marks(departures.events)]
    return replace(drawing, events=marks, moves=any(event.kind == "inverter" for event in events))


def _marks(departures: Iterable[PlantEvent]) -> Iterator[Mark]:
    """Yield marks of departures; those of one moment share a mark."""
    by_time: dict[float, list[PlantEvent]] = {}
    for event in departures:
        if event.t > 0.0:
            by_time.setdefault(event.t, []).append(event)
    for t, of in by_time.items():
        what = ", ".join(dict.fromkeys(text for event in of if (text := _in_short(event))))
        yield Mark("live" if any(event.kind in ("switch", "load") for event in of) else "", t, what)


def _in_short(event: PlantEvent) -> str:
    """Return a departure in two words; "" if that takes more."""
    if event.kind == "link":
        return "links"
    if event.kind == "load":
        return f"load {event.subject}"
    match = re.match(r"(?:switch )?(\S+)(?: \(.*\))? (opened|closed|joined|left|died)\b", event.text)
    return f"{match[1]} {PRESENT[match[2]]}" if match else ""
