"""Departures of a run from its scenario: what people did or left undone, and the windows that it disturbs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.connectivity import switch_names
from gridpeers.plant.equipment.named_loads import load_name, named_loads
from gridpeers.scenarios.live.run_monitor import line_of
from gridpeers.scenarios.results.history import Window, as_they_came, windows
from gridpeers.scenarios.results.island_membership import is_closed
from gridpeers.scenarios.results.metrics import STEADY
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.participants import LISTS, netem_of
from gridpeers.wire.messages import PlantEvent

_SILENCE = re.compile(r"\S+ (is silent:|does not hear )")
_AGAIN = re.compile(r"\S+ (is heard again|hears .* again)")

_NOTICED = 1.0
"""Time (s) after the end of a fault until which a silence is its doing: states have to come and to be reported."""

_SHOWN = 3
"""Most departures in a note; metrics.json has all of them."""

NEAR = 1e-9
"""Times (s) that differ by less are the same: they are multiples of the plant's step."""


def few(lines: Sequence[str]) -> str:
    more = f", and {len(lines) - _SHOWN} more (metrics.json)" if len(lines) > _SHOWN else ""
    return f"{'; '.join(lines[:_SHOWN])}{more}"


@dataclass(frozen=True, kw_only=True)
class Departures:
    """The departures of a run from its scenario, and its windows of measurement, each kind in the order of time."""

    events: tuple[PlantEvent, ...]
    live: Mapping[str, str]
    """By label, the operations of each event that people made."""
    measured: tuple[Window, ...]
    disturbed: tuple[Window, ...]
    """Measured windows of the scenario that end after the first departure, or miss rows."""
    too_short: tuple[Window, ...]
    """Windows that the next event ended before the values could be steady."""
    not_reached: tuple[Window, ...]
    unrecorded: tuple[Window, ...]
    """Windows without numbers, as rows are missing at their end, where they are measured."""

    def lines(self, end: float = inf) -> list[str]:
        return [line_of(event).strip() for event in self.events if event.t < end]

    @property
    def note(self) -> str:
        """A sentence on the disturbed windows; "" if there are none."""
        if not self.disturbed:
            return ""
        lines = self.lines(self.disturbed[-1].end) or ["rows that are missing"]
        names = ", ".join(window.label for window in self.disturbed)
        return f"{names}: disturbed by what the scenario does not have: {few(lines)}"


def compare(
    scenario: ScenarioModel,
    feeder: Feeder,
    events: Sequence[PlantEvent],
    ended: float,
    missing: Sequence[tuple[float, float]] = (),
) -> Departures:
    """Compare a run of one case, whose last row was at `ended` (s), with its scenario.

    A live event opens a window, which lasts to the next event or to the end of the run, and ends the one before it. At
    the moment of an event of the scenario it belongs to the window of that event. `missing` has the times (s) of the
    rows before and after each interval without rows.
    """
    meant = windows([(event.label, event.t_s) for event in scenario.events], scenario.time.end_s)
    scripted = windows(as_they_came(scenario, events), scenario.time.end_s)
    switched = tuple(_switched(scenario, feeder, events))
    commands = (event for event in events if event.kind == "link" and event.subject == "links")
    departures = sorted((*switched, *_moved(scenario, feeder, events, meant, ended), *commands), key=lambda one: one.t)
    first = departures[0].t if departures else ended
    live = {t: f"live at {round(t, 3):.12g} s" for t in dict.fromkeys(event.t for event in switched)}
    starts = [window.start for window in scripted]
    opening = [t for t in live if all(abs(t - start) > NEAR for start in starts)]
    reached, not_reached = [], []
    for plan, window in zip(meant, scripted, strict=True):
        cut = [t for t in opening if window.start < t < window.end - NEAR]
        if cut or plan.end <= ended + NEAR:
            reached.append(replace(window, end=cut[0]) if cut else window)
        else:
            not_reached.append(plan)
    starts += opening
    for t in opening:
        end = min((start for start in starts if start > t), default=ended)
        reached.append(Window(label=live[t], start=t, end=min(end, ended)))
    reached.sort(key=lambda window: window.start)
    shortest = max(STEADY, 2.0 * scenario.time.record_s) - NEAR
    too_short = [one for one in reached if one not in scripted and one.end - one.start < shortest]
    whole = [one for one in reached if one not in too_short]
    unrecorded = [one for one in whole if any(a < one.end and b > one.end - STEADY - NEAR for a, b in missing)]
    measured = tuple(one for one in whole if one not in unrecorded)
    labels = {window.label for window in measured}
    return Departures(
        events=tuple(departures),
        live={label: "; ".join(one.text for one in switched if one.t == t) for t, label in live.items()},
        measured=measured,
        disturbed=tuple(
            window
            for window in meant
            if window.label in labels
            and (first < window.end - NEAR or any(a < window.end and b > window.start for a, b in missing))
        ),
        too_short=tuple(too_short),
        not_reached=tuple(not_reached),
        unrecorded=tuple(unrecorded),
    )


def _switched(scenario: ScenarioModel, feeder: Feeder, events: Iterable[PlantEvent]) -> Iterator[PlantEvent]:
    """Yield the switches that people operated and the loads that they set; opening an open switch changes nothing."""
    switches, loads = switch_names(feeder), named_loads(feeder)
    planned: list[tuple[object, str, float, float]] = []
    for event in scenario.events:
        latest = event.t_s + (scenario.plant.sync_check.timeout if event.synchronised else 0.0)
        planned += [(False, switches[name], event.t_s, event.t_s) for name in event.open]
        planned += [(True, switches[name], event.t_s, latest) for name in event.close]
        planned += [("load", load_name(loads, text), event.t_s, event.t_s) for text in event.load]
    for came in events:
        if came.kind not in ("switch", "load") or came.text.endswith(" already"):
            continue
        done: tuple[object, str] = ("load", came.subject)
        if came.kind == "switch":
            done = is_closed(came), switches.get(came.subject, came.subject)
        if not any(done == (*what,) and since - NEAR < came.t < until + NEAR for *what, since, until in planned):
            yield came


class _Due(NamedTuple):
    """A move of an agent that the scenario asks people, or the driver, to make."""

    verb: str
    """As the plant's events say it: "left", "joined" or "died"."""
    name: str
    since: float
    until: float
    """Times (s) between which it may happen."""
    complaint: str = ""
    """Text of the departure if it has not happened by the deadline (s); "" if it need not."""
    deadline: float = inf


def _moved(
    scenario: ScenarioModel, feeder: Feeder, events: Iterable[PlantEvent], meant: Sequence[Window], ended: float
) -> Iterator[PlantEvent]:
    due = [*_due(scenario, meant)]
    (case,) = scenario.cases
    netem = netem_of(scenario, case)
    faults = [entry for entries in LISTS for entry in getattr(netem, entries.name)]
    first = {row.name for row in feeder.inverters}
    for event in events:
        if event.kind != "roster" or _AGAIN.match(event.text):
            continue
        if _SILENCE.match(event.text) and any(
            fault.from_s <= event.t < (inf if fault.to_s is None else fault.to_s + _NOTICED) for fault in faults
        ):
            continue  # a fault of the scenario may silence agents
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
