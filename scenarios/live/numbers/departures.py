"""Compare a wall-clock run with its scenario: find what people did or left undone, and when it ended. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

import msgspec

from plant.equipment import Feeder
from plant.network import Network
from scenarios.live.numbers.expected_silence import ExpectedSilence
from scenarios.live.numbers.windows import NEAR, LiveWindows, events_by_hand, opened
from scenarios.live.show.events import line_of
from scenarios.results.event_windows import Window, as_they_came, windows
from scenarios.results.steadiness import STEADY
from scenarios.schema import ScenarioModel
from scenarios.schema.netem_tables import netem_of
from wire.messages import PlantEvent


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A wall-clock run compared with its scenario."""

    ended: float
    """When it ended (s)."""
    measured: ScenarioModel
    """The scenario as far as the last of its windows that is measured; its end is that one's, as it is meant."""
    happened: ScenarioModel
    """The scenario with the events that came, those among them that people made by operating switches."""
    opened: LiveWindows
    """The windows of measurement of these events."""
    by_hand: Mapping[str, str]
    """What people did at each event of theirs, by its label."""
    departures: tuple[PlantEvent, ...]
    """What the scenario does not tell, in the order of time."""
    disturbed: tuple[str, ...]
    """Events of the scenario before the end of whose window, as it is meant, there was a departure: the plant
    remembers whatever happened to it. Also those in whose window rows are missing."""
    unrecorded: tuple[Window, ...]
    """Windows without numbers, as rows are missing at their end, where they are measured."""

    def lines(self, end: float = inf) -> list[str]:
        """Return the departures before a time (s), one line each."""
        return [line_of(event).strip() for event in self.departures if event.t < end]


class _Due(NamedTuple):
    """What an agent has to do, by the hand of people or of the driver."""

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


def compare(
    scenario: ScenarioModel,
    feeder: Feeder,
    events: Sequence[PlantEvent],
    ended: float,
    missing: Sequence[tuple[float, float]] = (),
) -> Compared:
    """Compare a run with its scenario.

    Parameters
    ----------
    scenario : ScenarioModel
        As run, with its one case.
    feeder : Feeder
        Its feeder.
    events : Sequence[PlantEvent]
        What the plant told.
    ended : float
        Time (s) of the last row.
    missing : Sequence[tuple[float, float]], optional
        Times (s) of the rows before and after each interval of which there are none.
    """
    every = windows([(event.label, event.t_s) for event in scenario.events], scenario.time.end_s)
    switched = tuple(_switched(scenario, feeder, events))
    by_hand = events_by_hand(switched)
    found = (*switched, *_moved(scenario, feeder, events, every, ended))
    found += tuple(event for event in events if event.kind == "link")
    departures = tuple(sorted(found, key=lambda event: event.t))
    first = min((event.t for event in departures), default=ended)
    all_opened = opened(scenario, as_they_came(scenario, events), by_hand, ended)
    unrecorded = tuple(
        w for w in all_opened.measured if any(a < w.end and b > w.end - STEADY - NEAR for a, b in missing)
    )
    all_opened = replace(all_opened, measured=tuple(w for w in all_opened.measured if w not in unrecorded))
    known = {window.label for window in all_opened.measured}
    whole = max((number for number, window in enumerate(every, start=1) if window.label in known), default=0)
    # at the same moment, what people did comes first: the scenario's event is what was left behind
    came = sorted((*by_hand, *(event for event in scenario.events if event.t_s < ended)), key=lambda event: event.t_s)
    return Compared(
        ended=ended,
        measured=msgspec.structs.replace(
            scenario,
            events=scenario.events[:whole],
            time=msgspec.structs.replace(scenario.time, end_s=every[whole - 1].end if whole else scenario.time.end_s),
        ),
        happened=msgspec.structs.replace(scenario, events=tuple(came)),
        opened=all_opened,
        by_hand={event.label: "; ".join(one.text for one in switched if one.t == event.t_s) for event in by_hand},
        departures=departures,
        disturbed=tuple(
            window.label
            for window in every
            if window.label in known
            and (first < window.end - NEAR or any(a < window.end and b > window.start for a, b in missing))
        ),
        unrecorded=unrecorded,
    )


def _switched(scenario: ScenarioModel, feeder: Feeder, events: Iterable[PlantEvent]) -> Iterable[PlantEvent]:
    """Yield switches that somebody operated; opening an open switch changes nothing."""
    network = Network(feeder)
    planned = [
        (event.t_s, network.switch_name(name)) for event in scenario.events for name in (*event.open, *event.close)
    ]
    for event in events:
        if event.kind != "switch" or event.text.endswith(" already"):
            continue
        if not any(abs(event.t - t) < NEAR and event.subject == name for t, name in planned):
            yield event


def _moved(
    scenario: ScenarioModel, feeder: Feeder, events: Iterable[PlantEvent], every: Sequence[Window], ended: float
) -> Iterable[PlantEvent]:
    """Yield agents that joined, left or died against the scenario, and those that should have and did not."""
    due = [*_due(scenario, every)]
    expected = ExpectedSilence(scenario, feeder)
    first = {row.name for row in feeder.inverters}
    for event in events:
        if event.kind != "roster":
            continue
        if expected(event):
            continue
        match = re.match(rf"{re.escape(event.subject)} (joined|left|died)", event.text)
        verb = match[1] if match else ""
        if event.t == 0.0 and verb and event.subject in first:
            continue  # who is missing at the start is told by "started without"
        met = [
            one
            for one in due
            if (one.verb, one.name) == (verb, event.subject) and one.since - NEAR <= event.t < one.until
        ]
        if not met:
            yield event
        elif met[0].told:
            due.remove(met[0])
    for one in due:
        if one.told and one.missed <= ended + NEAR:
            yield PlantEvent(t=one.since, kind="roster", subject=one.name, text=one.told)


def _due(scenario: ScenarioModel, every: Sequence[Window]) -> Iterable[_Due]:
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
