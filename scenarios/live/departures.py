"""Departures of a run from its scenario: what people did or left undone, and the windows that it disturbs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
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
    feeder: Feeder,
    events: Sequence[PlantEvent],
    ended: float,
    missing: Sequence[tuple[float, float]] = (),
) -> Departures:
    """Compare a run of one case, whose last row was at `ended` (s), with its scenario.

    A switch or load that people operate opens a window, which lasts to the next event or to the end of the run, and
    ends the one before it. At the moment of an event of the scenario it belongs to the window of that event. `missing`
    has the times (s) of the rows before and after each interval without rows.
    """
    departures = sorted(_departures(scenario, feeder, events, ended), key=lambda one: one.t)
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


class _Planned(NamedTuple):
    """A switch, a load or an agent that the scenario changes."""

    done: str
    """As the plant's events say it: "closed", "opened", "load", "left", "joined" or "died"."""
    name: str
    since: float
    until: float
    """Times (s) between which it may happen."""


def _planned(scenario: ScenarioModel, feeder: Feeder) -> Iterator[_Planned]:
    switches, loads = switch_names(feeder), named_loads(feeder)
    ends = [*(event.t_s for event in scenario.events), scenario.time.end_s][1:]
    for event, end in zip(scenario.events, ends, strict=True):
        t, latest = event.t_s, event.t_s + (scenario.plant.sync_check.timeout if event.synchronised else 0.0)
        yield from (_Planned("opened", switches[name], t, t + NEAR) for name in event.open)
        yield from (_Planned("closed", switches[name], t, latest + NEAR) for name in event.close)
        yield from (_Planned("load", load_name(loads, text), t, t + NEAR) for text in event.load)
        yield from (_Planned("left", name, t, end) for name in event.leave)
        yield from (_Planned("joined", name, t, end) for name in event.join)
    (case,) = scenario.cases
    for node in netem_of(scenario, case).nodes:
        if node.kill or node.pause:
            yield _Planned("died", node.name, node.from_s, inf)
        if node.pause:  # an agent paused for longer than Zenoh's lease counts as dead, until it goes on
            yield _Planned("joined", node.name, node.from_s, inf)


def _departures(
    scenario: ScenarioModel, feeder: Feeder, events: Sequence[PlantEvent], ended: float
) -> Iterator[PlantEvent]:
    """Yield each event that the scenario does not have, and one for each agent that did not leave or join in time."""
    switches, planned = switch_names(feeder), [*_planned(scenario, feeder)]
    (case,) = scenario.cases
    netem = netem_of(scenario, case)
    faults = [entry for entries in LISTS for entry in getattr(netem, entries.name)]
    first, came = {row.name for row in feeder.inverters}, set[_Planned]()
    for event in events:
        done, name = "", event.subject
        if event.kind in ("switch", "load") and event.text.endswith(" already"):
            continue  # to open an open switch changes nothing
        if event.kind == "switch":
            done, name = "closed" if is_closed(event) else "opened", switches.get(name, name)
        elif event.kind == "load":
            done = "load"
        elif event.kind == "roster" and not _AGAIN.match(event.text):
            if _SILENCE.match(event.text) and any(
                fault.from_s <= event.t < (inf if fault.to_s is None else fault.to_s + _NOTICED) for fault in faults
            ):
                continue  # a fault of the scenario may silence agents
            match = re.match(rf"{re.escape(name)} (joined|left|died)", event.text)
            done = match[1] if match else ""
            if event.t == 0.0 and done and name in first:
                continue  # another event, "started without", names the agents that are absent at the start
        elif (event.kind, name) != ("link", "links"):
            continue
        it = [
            it for it in planned if it[:2] == (done, name) and it.since - NEAR <= event.t < it.until and it not in came
        ]
        if not it:
            yield event
        elif it[0].until < inf and done in ("left", "joined"):
            came.add(it[0])
    for one in planned:
        if one.done in ("left", "joined") and one.until <= ended + NEAR and one not in came:
            text = f"{one.name} was to {'leave' if one.done == 'left' else 'join'}, and did not in time"
            yield PlantEvent(t=one.since, kind="roster", subject=one.name, text=text)
