"""Departures of a run from its scenario: what people did or left undone, and the windows that it disturbs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.bus_islands import switch_names
from gridpeers.plant.equipment.named_loads import load_name, named_loads
from gridpeers.scenarios.live.numbers.expected_silence import ExpectedSilence
from gridpeers.scenarios.live.numbers.live_windows import NEAR, LiveWindows, live_events, live_windows
from gridpeers.scenarios.live.show.snapshot import line_of
from gridpeers.scenarios.results.event_windows import Window, windows
from gridpeers.scenarios.results.island_membership import is_closed
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.netem_tables import netem_of
from gridpeers.wire.messages import PlantEvent

_SHOWN = 3
"""Most departures in a note; metrics.json has all of them."""


def few(lines: Sequence[str]) -> str:
    """Return the first lines, and the number of the others."""
    more = f", and {len(lines) - _SHOWN} more (metrics.json)" if len(lines) > _SHOWN else ""
    return f"{'; '.join(lines[:_SHOWN])}{more}"


@dataclass(frozen=True, kw_only=True)
class Departures:
    """The departures of a run from its scenario, and its windows of measurement."""

    events: tuple[PlantEvent, ...]
    """The departures, in the order of time."""
    disturbed: tuple[Window, ...]
    """Measured windows of the scenario, as it means them, that end after the first departure or miss rows: the plant
    remembers whatever happened to it."""
    windows: LiveWindows
    """The windows of the scenario's events, and of those that people made on switches and loads."""
    live: Mapping[str, str]
    """By label, the operations of each event that people made."""

    def lines(self, end: float = inf) -> list[str]:
        """Return the departures before a time (s), one line each."""
        return [line_of(event).strip() for event in self.events if event.t < end]

    @property
    def note(self) -> str:
        """A sentence on the disturbed windows; "" if there are none."""
        if not self.disturbed:
            return ""
        lines = self.lines(self.disturbed[-1].end) or ["rows that are missing"]
        names = ", ".join(window.label for window in self.disturbed)
        return f"{names}: not what the scenario means by it, which does not tell of: {few(lines)}"


class _Due(NamedTuple):
    """A move of an agent that the scenario asks people, or the driver, to make."""

    verb: str
    """As the plant's events say it: "left", "joined" or "died"."""
    name: str
    since: float
    until: float
    """Times (s) between which it may happen."""
    complaint: str = ""
    """Text of the departure if it does not happen; "" if it need not."""
    deadline: float = inf
    """From when (s) on it is missing."""


def compare(
    scenario: ScenarioModel,
    feeder: Feeder,
    events: Sequence[PlantEvent],
    ended: float,
    missing: Sequence[tuple[float, float]] = (),
) -> Departures:
    """Compare a run with its scenario.

    Parameters
    ----------
    scenario, feeder : ScenarioModel, Feeder
        As run, with one case.
    events : Sequence[PlantEvent]
        The plant's events.
    ended : float
        Time (s) of the last row.
    missing : Sequence[tuple[float, float]], optional
        Times (s) of the rows before and after each interval without rows.
    """
    meant = windows([(event.label, event.t_s) for event in scenario.events], scenario.time.end_s)
    switched = tuple(_switched(scenario, feeder, events))
    commands = (event for event in events if event.kind == "link" and event.subject == "links")
    departures = sorted((*switched, *_moved(scenario, feeder, events, meant, ended), *commands), key=lambda one: one.t)
    first = departures[0].t if departures else ended
    live = live_events(switched)
    opened = live_windows(scenario, events, live, ended, missing)
    measured = {window.label for window in opened.measured}
    return Departures(
        events=tuple(departures),
        disturbed=tuple(
            window
            for window in meant
            if window.label in measured
            and (first < window.end - NEAR or any(a < window.end and b > window.start for a, b in missing))
        ),
        windows=opened,
        live={label: "; ".join(one.text for one in switched if one.t == t) for label, t in live},
    )


def _switched(scenario: ScenarioModel, feeder: Feeder, events: Iterable[PlantEvent]) -> Iterator[PlantEvent]:
    """Yield the switches that people operated and the loads that they set; opening an open switch changes nothing."""
    switches, loads = switch_names(feeder), named_loads(feeder)
    timeout = scenario.plant.sync_check.timeout
    planned = [
        (f"switch {closes}", switches[name], event.t_s, event.t_s + (timeout if closes and event.synchronised else 0.0))
        for event in scenario.events
        for names, closes in ((event.open, False), (event.close, True))
        for name in names
    ]
    planned += [
        ("load", load_name(loads, text), event.t_s, event.t_s) for event in scenario.events for text in event.load
    ]
    for event in events:
        if event.kind not in ("switch", "load") or event.text.endswith(" already"):
            continue
        if event.kind == "switch":
            done = f"switch {is_closed(event)}", switches.get(event.subject, event.subject)
        else:
            done = "load", event.subject
        if not any(
            done == (what, name) and since - NEAR < event.t < until + NEAR for what, name, since, until in planned
        ):
            yield event


def _moved(
    scenario: ScenarioModel, feeder: Feeder, events: Iterable[PlantEvent], meant: Sequence[Window], ended: float
) -> Iterator[PlantEvent]:
    """Yield the agents that joined, left or died against the scenario, and those that should have and did not."""
    due = [*_due(scenario, meant)]
    expected = ExpectedSilence(scenario, feeder)
    first = {row.name for row in feeder.inverters}
    for event in events:
        if event.kind != "roster" or expected(event):
            continue
        match = re.match(rf"{re.escape(event.subject)} (joined|left|died)", event.text)
        verb = match[1] if match else ""
        if event.t == 0.0 and verb and event.subject in first:
            continue  # another event, "started without", names the agents that are absent at the start
        planned = [
            one
            for one in due
            if (one.verb, one.name) == (verb, event.subject) and one.since - NEAR <= event.t < one.until
        ]
        if not planned:
            yield event
        elif planned[0].complaint:
            due.remove(planned[0])
    for one in due:
        if one.complaint and one.deadline <= ended + NEAR:
            yield PlantEvent(t=one.since, kind="roster", subject=one.name, text=one.complaint)


def _due(scenario: ScenarioModel, meant: Sequence[Window]) -> Iterator[_Due]:
    for event, window in zip(scenario.events, meant, strict=True):
        start, end = window.start, window.end
        for name in event.leave:
            yield _Due("left", name, start, end, f"{name} was to leave, and nobody had it leave in time", end)
        for name in event.join:
            yield _Due("joined", name, start, end, f"{name} was to join, and nobody started it in time", end)
    (case,) = scenario.cases
    for node in netem_of(scenario, case).nodes:
        if node.kill:
            yield _Due("died", node.name, node.from_s, inf, f"{node.name} was to be killed, and was not", node.from_s)
        elif node.pause:  # an agent paused for longer than Zenoh's lease counts as dead, until it goes on
            yield _Due("died", node.name, node.from_s, inf)
            yield _Due("joined", node.name, node.from_s, inf)
