"""The inverters of each island after each event of a scenario, and the part of a history that is one island's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from math import inf
from typing import NamedTuple

import numpy as np

from plant.equipment import Feeder
from plant.equipment.bus_islands import islands_after
from scenarios.results.history import Floats, History, Nameplates
from scenarios.schema import ScenarioModel
from scenarios.schema.participants import inverters_of

IslandMembers = dict[str, tuple[str, ...]]
"""Inverters of each island; an island is known by its first inverter."""


class IslandInterval(NamedTuple):
    """A time during which there are several islands."""

    start: float
    """From the event that made them (s)."""
    end: float
    """To the next event, or for good (s)."""
    islands: IslandMembers


RowMeasure = Callable[[History, Nameplates], Floats]
"""A measure of each row."""


def islands_of(scenario: ScenarioModel, feeder: Feeder) -> dict[str, IslandMembers]:
    """Return the islands with inverters in them after each event, by its label.

    Switches alone decide: an inverter that has left is still counted where it stands.

    Examples
    --------
    >>> from scenarios.schema import load_scenario
    >>> islands_of(*load_scenario("microgrid-switching"))["event2"]["inv4"]
    ('inv4', 'inv5', 'inv6')
    """
    rows = inverters_of(scenario, feeder)
    islands = {}
    after = islands_after(feeder, ((event.open, event.close) for event in scenario.events))
    for event, parts in zip(scenario.events, after, strict=True):
        members = [tuple(row.name for row in rows if row.bus in buses) for buses in parts]
        known = {names[0]: names for names in members if names}
        islands[event.label] = {row.name: known[row.name] for row in rows if row.name in known}
    return islands


def part_of(history: History, nameplates: Nameplates, names: tuple[str, ...]) -> tuple[History, Nameplates]:
    """Return the columns of some inverters alone, as if there were no others."""
    at = np.array([history.inverters.index(name) for name in names])
    columns = {
        field.name: getattr(history, field.name)[:, at]
        for field in fields(history)
        if field.name not in ("inverters", "t")
    }
    mine = {field.name: getattr(nameplates, field.name)[at] for field in fields(nameplates) if field.name != "names"}
    return replace(history, inverters=names, **columns), replace(nameplates, names=names, **mine)


def taken_part(scenario: ScenarioModel, feeder: Feeder, history: History) -> History:
    """Return a history without the spare inverters that nobody ever started.

    In a live run all spare inverters have columns; in others those have that the scenario lets join.
    """
    own, present = {row.name for row in inverters_of(scenario, feeder)}, history.present
    names = tuple(name for i, name in enumerate(history.inverters) if name in own or bool(present[:, i].any()))
    return part_of(history, Nameplates.of_columns(history.inverters, feeder), names)[0]


def island_intervals(scenario: ScenarioModel, feeder: Feeder) -> tuple[IslandInterval, ...]:
    """Return the times with several islands, and these islands."""
    starts = [event.t_s for event in scenario.events]
    times = zip(starts, [*starts, inf][1:], islands_of(scenario, feeder).values(), strict=True)
    return tuple(IslandInterval(start, end, islands) for start, end, islands in times if len(islands) > 1)


def worst(quantity: RowMeasure, nominal: float, island_intervals: Sequence[IslandInterval]) -> RowMeasure:
    """Return the measure of the island in which it is farthest from its nominal value, while there are several.

    A mean over islands hides their errors: one is too fast, another too slow.
    """

    def measure(history: History, nameplates: Nameplates) -> Floats:
        values = quantity(history, nameplates)
        for interval in island_intervals:
            rows = (history.t > interval.start) & (history.t <= interval.end)
            inside = history.rows(rows)
            each = np.stack([quantity(*part_of(inside, nameplates, names)) for names in interval.islands.values()])
            far = np.nan_to_num(np.abs(each - nominal), nan=-1.0).argmax(axis=0)
            values[rows] = np.take_along_axis(each, far[None, :], axis=0)[0]
        return values

    return measure
