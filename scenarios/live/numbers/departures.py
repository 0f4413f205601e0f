"""Where a run by hand departs from its scenario: what people did or left undone, and when it ended. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import msgspec

from plant.equipment import Feeder
from plant.network import Network
from scenarios.results.metrics import Window, windows
from scenarios.spec import Scenario
from scenarios.spec.netem import netem_of
from wire.messages import PlantEvent

_NEAR = 1e-9
"""Times (s) that differ by less are the same: they are multiples of the plant's step."""


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A run by hand beside its scenario."""

    ended: float
    """When it ended (s)."""
    measured: Scenario
    """The scenario as far as windows of events were reached to their end, which is where it ends."""
    not_reached: tuple[Window, ...]
    """The windows that were not."""
    departures: tuple[PlantEvent, ...]
    """What the scenario does not tell, in the order of time."""
    disturbed: tuple[str, ...]
    """Events before the end of whose window there was a departure: the plant remembers whatever happened to it."""


class _Due(NamedTuple):
    """What people, or the driver, are to have an agent do."""

    verb: str
    """As the plant tells it: "left", "joined" or "died"."""
    name: str
    since: float
    until: float
    """Between which times (s) it may be."""
    told: str
    """What to say if it has not come to pass; "" if it need not."""
    missed: float
    """From when (s) on it has not."""


def compare(scenario: Scenario, feeder: Feeder, events: Sequence[PlantEvent], ended: float) -> Compared:
    """See how far a run by hand is what its scenario says.

    Parameters
    ----------
    scenario : Scenario
        As run, with its one case.
    feeder : Feeder
        Its feeder.
    events : Sequence[PlantEvent]
        What the plant told.
    ended : float
        Time (s) of the last row.
    """
    every = windows([(event.label, event.t_s) for event in scenario.events], scenario.time.end_s)
    whole = [window for window in every if window.end <= ended + _NEAR]
    found = (*_switched(scenario, feeder, events), *_moved(scenario, feeder, events, every, ended))
    found += tuple(event for event in events if event.kind == "link")
    departures = tuple(sorted(found, key=lambda event: event.t))
    first = min((event.t for event in departures), default=ended)
    end = whole[-1].end if whole else scenario.time.end_s
    return Compared(
        ended=ended,
        measured=msgspec.structs.replace(
            scenario,
            events=scenario.events[: len(whole)],
            time=msgspec.structs.replace(scenario.time, end_s=end),
        ),
        not_reached=every[len(whole) :],
        departures=departures,
        disturbed=tuple(window.label for window in whole if first < window.end - _NEAR),
    )


def _switched(scenario: Scenario, feeder: Feeder, events: Iterable[PlantEvent]) -> Iterable[PlantEvent]:
    """Switches that somebody operated; who opens what is open already changes nothing."""
    network = Network(feeder)
    planned = [
        (event.t_s, network.switch_name(name)) for event in scenario.events for name in (*event.open, *event.close)
    ]
    for event in events:
        if event.kind != "switch" or event.text.endswith(" already"):
            continue
        if not any(abs(event.t - t) < _NEAR and event.subject == name for t, name in planned):
            yield event


def _moved(
    scenario: Scenario, feeder: Feeder, events: Iterable[PlantEvent], every: Sequence[Window], ended: float
) -> Iterable[PlantEvent]:
    """Agents that came, went or died though the scenario does not say so, and those that should have and did not."""
    due = [*_due(scenario, every)]
    first = {row.name for row in feeder.inverters}
    for event in events:
        if event.kind != "roster":
            continue
        match = re.match(rf"{re.escape(event.subject)} (joined|left|died)", event.text)
        verb = match[1] if match else ""
        if event.t == 0.0 and verb and event.subject in first:
            continue  # who is missing at the start is told by "started without"
        met = [
            one
            for one in due
            if (one.verb, one.name) == (verb, event.subject) and one.since - _NEAR <= event.t < one.until
        ]
        if not met:
            yield event
        elif met[0].told:
            due.remove(met[0])
    for one in due:
        if one.told and one.missed <= ended + _NEAR:
            yield PlantEvent(t=one.since, kind="roster", subject=one.name, text=one.told)


def _due(scenario: Scenario, every: Sequence[Window]) -> Iterable[_Due]:
    for event, window in zip(scenario.events, every, strict=True):
        start, end = window.start, window.end
        for name in event.leave:
            yield _Due("left", name, start, end, f"{name} was to leave, and nobody had it leave in time", end)
        for name in event.join:
            yield _Due("joined", name, start, end, f"{name} was to join, and nobody started it in time", end)
    (case,) = scenario.cases
    for node in netem_of(scenario, case).nodes:
        if node.kill:
            yield _Due("died", node.name, node.from_s, inf, f"{node.name} was to be killed, and was not", node.from_s)
        elif node.pause:  # who stands still for longer than Zenoh's lease counts as dead, until it goes on
            for verb in ("died", "joined"):
                yield _Due(verb, node.name, node.from_s, inf, "", inf)
