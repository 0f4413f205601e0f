"""What the figures of a run by hand share: the whole run, with all that people did in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import msgspec

from plant.equipment import Feeder
from scenarios.live.numbers.departures import Compared
from scenarios.results.drawing import Drawing, drawing_of
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
    marks = as_they_came(msgspec.structs.replace(scenario, events=reached), events)
    marks += [("by hand" if event.kind == "switch" else "", event.t) for event in compared.departures if event.t > 0.0]
    marks = list(dict.fromkeys(marks))
    taken, plates = taken_part(scenario, feeder, history)
    drawing = drawing_of(compared.happened, feeder, plates, {case: taken}, marks)
    return replace(drawing, moves=any(event.kind == "inverter" for event in events))
