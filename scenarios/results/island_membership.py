"""The islands of a run over time, by its switches as recorded, and the part of a history that is one island's."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from itertools import groupby
from math import inf
from typing import NamedTuple

import numpy as np

from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.connectivity import bus_islands, switch_name, switch_names
from gridpeers.plant.simulators import SIMULATORS
from gridpeers.scenarios.results.history import UNITS, Floats, History, Nameplates, Window
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.messages import PlantEvent


def switch_events(scenario: ScenarioModel, feeder: Tables, recorded: Iterable[PlantEvent]) -> tuple[PlantEvent, ...]:
    """Return the operations of switches that a plant recorded, in the order of time.

    A federation's plant need not record any: then they are those that the scenario plans. Of every other plant, no
    event means no operation; a run folder without its events.csv cannot be read.
    """
    told = tuple(event for event in recorded if event.kind == "switch")
    if told or not SIMULATORS.resolve(scenario.plant.simulator).elsewhere:
        return told
    return tuple(
        PlantEvent(t=event.t_s, kind="switch", subject=switch_name(feeder, name), text="as planned", closed=closed)
        for event in scenario.events
        for names, closed in ((event.open, False), (event.close, True))
        for name in names
    )


def closed_switches(
    feeder: Tables, events: Iterable[PlantEvent], before: Collection[str] | None = None
) -> frozenset[str]:
    """Return the switches that are closed after some events; `before` are those closed before, by default at the start.

    A switch that waits for synchronism has no event of kind "switch" until it closes.
    """
    names = switch_names(feeder)
    closed = {switch.name for switch in feeder.switches if switch.closed} if before is None else set(before)
    for event in events:
        if event.subject not in names:
            continue  # an outside plant may have others
        if event.closed:
            closed.add(names[event.subject])
        else:
            closed.discard(names[event.subject])
    return frozenset(closed)


class RecordedIsland(NamedTuple):
    inverters: tuple[str, ...]
    """Inverters at its buses, in the order of the history's columns; one that has left is still counted."""
    fed: bool
    """True if the substation is part of it."""


Islands = Mapping[str, RecordedIsland]  # Islands by name: that of the first inverter


class IslandInterval(NamedTuple):
    start: float
    """Time of the operations of switches that begin it (s); minus infinity for the start of the run."""
    end: float
    """Time of the next operation (s); infinity if there is none."""
    islands: Islands


RowMeasure = Callable[[History, Nameplates], Floats]  # A measure of each row


def island_intervals(
    scenario: ScenarioModel, feeder: Tables, inverters: Sequence[str], recorded: Iterable[PlantEvent]
) -> tuple[IslandInterval, ...]:
    """Return the islands of a run over time, in the order of time and without gaps.

    Switches alone decide, as they were recorded: one that waits for synchronism has not closed yet.
    """
    closed = closed_switches(feeder, ())
    states = [(-inf, closed)]
    for t, operations in groupby(switch_events(scenario, feeder, recorded), key=lambda event: event.t):
        closed = closed_switches(feeder, operations, closed)
        states.append((t, closed))
    ends = [*(t for t, _ in states), inf][1:]
    return tuple(
        IslandInterval(start, end, _islands(feeder, inverters, closed))
        for (start, closed), end in zip(states, ends, strict=True)
    )


def _islands(feeder: Tables, inverters: Sequence[str], closed: frozenset[str]) -> Islands:
    bus_of = {row.name: row.bus for row in (*feeder.inverters, *feeder.spares)}
    source = feeder.source.bus if feeder.source else None
    around = {bus: buses for buses in bus_islands(feeder, closed) for bus in buses}
    members: dict[frozenset[str], list[str]] = {}
    for name in inverters:
        members.setdefault(around[bus_of[name]], []).append(name)
    return {names[0]: RecordedIsland(tuple(names), source in buses) for buses, names in members.items()}


def islands_at_end(intervals: Sequence[IslandInterval], window: Window) -> Islands:
    """Return the islands at the end of a window, by which it is measured and judged.

    An operation at the very end belongs to the next window.
    """
    return next(it.islands for it in reversed(intervals) if it.start < window.end - 1e-9)


def part_of(history: History, nameplates: Nameplates, names: tuple[str, ...]) -> tuple[History, Nameplates]:
    """Return the columns of some inverters alone, as if there were no others."""
    at = np.array([history.inverters.index(name) for name in names])
    columns = {name: getattr(history, name)[:, at] for name in UNITS if name != "t"}
    mine = {field.name: getattr(nameplates, field.name)[at] for field in fields(nameplates) if field.name != "names"}
    return replace(history, inverters=names, **columns), replace(nameplates, names=names, **mine)


def taken_part(scenario: ScenarioModel, feeder: Tables, history: History) -> History:
    """Return the history of a live run without the spare inverters that nobody ever started."""
    own = {row.name for row in inverters_of(scenario, feeder)}
    if own.issuperset(history.inverters):
        return history
    present = history.present
    names = tuple(name for i, name in enumerate(history.inverters) if name in own or bool(present[:, i].any()))
    return part_of(history, Nameplates.of_columns(history.inverters, feeder), names)[0]


def worst(
    quantity: RowMeasure,
    nominal: float,
    island_intervals: Iterable[IslandInterval],
    history: History,
    nameplates: Nameplates,
) -> Floats:
    """Return the measure of the island in which it is farthest from its nominal value, while there are several.

    A mean over islands hides their errors: one is too fast, another too slow. Each row has the islands of its time; a
    row at the very moment of an operation those of before.
    """
    values = quantity(history, nameplates)
    for interval in island_intervals:
        if len(interval.islands) > 1:
            rows = (history.t > interval.start) & (history.t <= interval.end)
            inside = history.rows(rows)
            parts = (part_of(inside, nameplates, island.inverters) for island in interval.islands.values())
            each = np.stack([quantity(*part) for part in parts])
            far = np.nan_to_num(np.abs(each - nominal), nan=-1.0).argmax(axis=0)
            values[rows] = np.take_along_axis(each, far[None, :], axis=0)[0]
    return values
