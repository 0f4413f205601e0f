"""Departures of a run from its scenario: what people did, and the windows that it disturbs."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.connectivity import switch_names
from gridpeers.plant.equipment.named_loads import load_name, named_loads
from gridpeers.scenarios.live.run_monitor import line_of
from gridpeers.scenarios.results.history import Window, as_they_came, windows
from gridpeers.scenarios.results.metrics import STEADY
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.participants import LISTS, netem_of
from gridpeers.wire.messages import PlantEvent

_SILENCE = re.compile(r"\S+ (is silent:|does not hear )")
_NOTHING = re.compile(r" already$|^\S+ (is heard again|hears .* again)")
"""To open an open switch changes nothing; a silence has ended."""

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
    events: tuple[PlantEvent, ...]
    live: Mapping[str, str]
    """By label of the window, the operations that people made at its start."""
    measured: tuple[Window, ...]
    unmeasured: tuple[Window, ...]
    """Windows that the run did not finish, that are too short to be steady, or without rows at their end."""
    disturbed: tuple[Window, ...]
    """Measured windows of the scenario that end after the first departure, or miss rows."""

    @property
    def lines(self) -> list[str]:
        return [line_of(event).strip() for event in self.events]

    @property
    def note(self) -> str:
        if not self.disturbed:
            return ""
        names = ", ".join(window.label for window in self.disturbed)
        before = [line_of(event).strip() for event in self.events if event.t < self.disturbed[-1].end]
        return f"{names}: disturbed by what the scenario does not have: {few(before or ['rows that are missing'])}"


def compare(
    scenario: ScenarioModel,
    feeder: Tables,
    events: Sequence[PlantEvent],
    ended: float,
    missing: Sequence[tuple[float, float]] = (),
) -> Departures:
    """Compare a run of one case, whose last row was at `ended` (s), with its scenario.

    A switch or load that people operate opens a window, which lasts to the next event or to the end of the run, and
    ends the one before it. At the moment of an event of the scenario it belongs to the window of that event. `missing`
    has the times (s) of the rows before and after each interval without rows.
    """
    departures = sorted(_departures(scenario, feeder, events), key=lambda one: one.t)
    came = as_they_came(scenario, events)
    scripted = {window.label: window for window in windows(came, scenario.time.end_s)}
    live: dict[float, list[str]] = {}
    for event in departures:
        if event.kind in ("switch", "load"):
            live.setdefault(event.t, []).append(event.text)
    labels = {t: f"live at {round(t, 3):.12g} s" for t in live}
    opened = [(label, t) for t, label in labels.items() if all(abs(t - start) > NEAR for _, start in came)]
    measured, unmeasured = list[Window](), list[Window]()
    for window in windows(sorted([*came, *opened], key=lambda one: one[1]), inf):
        plan = scripted.get(window.label)
        window = replace(window, end=min(window.end, ended if plan is None else plan.end))
        whole = window.end <= ended + NEAR and (
            window == plan or window.end - window.start >= max(STEADY, 2.0 * scenario.time.record_s) - NEAR
        )
        holed = any(a < window.end and b > window.end - STEADY - NEAR for a, b in missing)
        (measured if whole and not holed else unmeasured).append(window)
    first = departures[0].t if departures else inf
    return Departures(
        events=tuple(departures),
        live={labels[t]: "; ".join(texts) for t, texts in live.items()},
        measured=tuple(measured),
        unmeasured=tuple(unmeasured),
        disturbed=tuple(
            window
            for window in measured
            if (plan := scripted.get(window.label)) is not None
            and (first < plan.end - NEAR or any(a < plan.end and b > plan.start for a, b in missing))
        ),
    )


def _departures(scenario: ScenarioModel, feeder: Tables, events: Iterable[PlantEvent]) -> Iterator[PlantEvent]:
    """Yield each event that the scenario does not have: of a switch, a load or an agent at another time, or of links.

    A fault of the scenario may silence agents, and kill or pause those that it names.
    """
    switches, planned, faults = switch_names(feeder), _planned(scenario, feeder), [*_faults(scenario)]
    for event in events:
        name = switches.get(event.subject, event.subject) if event.kind == "switch" else event.subject
        if event.kind not in ("switch", "load", "roster") and (event.kind, name) != ("link", "links"):
            continue
        if _NOTHING.search(event.text) or (event.t == 0.0 and " joined" in event.text):
            continue
        times = planned.get(name, ()) if not _SILENCE.match(event.text) else faults
        if not any(since - NEAR <= event.t < until + NEAR for since, until in times):
            yield event


def _planned(scenario: ScenarioModel, feeder: Tables) -> dict[str, list[tuple[float, float]]]:
    """Return the times (s) within which the scenario moves a switch, a load or an agent, by its name."""
    switches, loads = switch_names(feeder), named_loads(feeder)
    found = defaultdict[str, list[tuple[float, float]]](list)
    ends = [*(event.t_s for event in scenario.events), scenario.time.end_s][1:]
    for event, end in zip(scenario.events, ends, strict=True):
        t, latest = event.t_s, event.t_s + (scenario.plant.sync_check.timeout if event.synchronised else 0.0)
        for name, until in (
            *((switches[name], latest if name in event.close else t) for name in (*event.open, *event.close)),
            *((load_name(loads, text), t) for text in event.load),
            *((name, end - 2.0 * NEAR) for name in (*event.leave, *event.join)),
        ):
            found[name].append((t, until))
    (case,) = scenario.cases
    for node in netem_of(scenario, case).nodes:
        if node.kill or node.pause:
            found[node.name].append((node.from_s, inf))
    return found


def _faults(scenario: ScenarioModel) -> Iterator[tuple[float, float]]:
    (case,) = scenario.cases
    netem = netem_of(scenario, case)
    for fault in (entry for entries in LISTS for entry in getattr(netem, entries.name)):
        yield fault.from_s, inf if fault.to_s is None else fault.to_s + _NOTICED
