"""Departures of a run from its scenario: what people did or left undone, and the windows that it disturbs."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Literal, NamedTuple

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


State = Literal["measured", "too_short", "not_reached", "unrecorded"]
"""A window is "too_short" if the next event ended it before values can be steady, and "unrecorded" if rows are missing
at its end, where it is measured."""


@dataclass(frozen=True, kw_only=True)
class Departures:
    events: tuple[PlantEvent, ...]
    live: Mapping[str, str]
    """By label, the operations of each event that people made."""
    windows: tuple[tuple[Window, State], ...]
    disturbed: tuple[Window, ...]
    """Measured windows of the scenario that end after the first departure, or miss rows."""

    def those(self, *states: State) -> tuple[Window, ...]:
        return tuple(window for window, state in self.windows if state in states)

    def lines(self, end: float = inf) -> list[str]:
        return [line_of(event).strip() for event in self.events if event.t < end]

    @property
    def note(self) -> str:
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
    departures = sorted(_departures(scenario, feeder, events, meant, ended), key=lambda one: one.t)
    switched = [event for event in departures if event.kind in ("switch", "load")]
    live = {t: f"live at {round(t, 3):.12g} s" for t in dict.fromkeys(event.t for event in switched)}
    starts = [window.start for window in scripted]
    opening = [t for t in live if all(abs(t - start) > NEAR for start in starts)]
    starts += opening
    came, not_reached = [], []
    for plan, window in zip(meant, scripted, strict=True):
        cut = [t for t in opening if window.start < t < window.end - NEAR]
        if cut or plan.end <= ended + NEAR:
            came.append(replace(window, end=cut[0]) if cut else window)
        else:
            not_reached.append(plan)
    for t in opening:
        end = min((start for start in starts if start > t), default=ended)
        came.append(Window(label=live[t], start=t, end=min(end, ended)))
    shortest = max(STEADY, 2.0 * scenario.time.record_s) - NEAR

    def state(window: Window) -> State:
        if window not in scripted and window.end - window.start < shortest:
            return "too_short"
        holed = any(a < window.end and b > window.end - STEADY - NEAR for a, b in missing)
        return "unrecorded" if holed else "measured"

    reached = [(window, state(window)) for window in sorted(came, key=lambda window: window.start)]
    measured = {window.label for window, state in reached if state == "measured"}
    first = departures[0].t if departures else ended
    return Departures(
        events=tuple(departures),
        live={label: "; ".join(one.text for one in switched if one.t == t) for t, label in live.items()},
        windows=(*reached, *((window, "not_reached") for window in not_reached)),
        disturbed=tuple(
            window
            for window in meant
            if window.label in measured
            and (first < window.end - NEAR or any(a < window.end and b > window.start for a, b in missing))
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
    complaint: str = ""
    """Text of the departure if people, or the driver, have not done it in time; "" if it need not happen."""


def _planned(
    scenario: ScenarioModel, feeder: Feeder, switches: Mapping[str, str], meant: Sequence[Window]
) -> Iterator[_Planned]:
    loads = named_loads(feeder)
    for event, window in zip(scenario.events, meant, strict=True):
        t, start, end = event.t_s, window.start, window.end
        latest = t + (scenario.plant.sync_check.timeout if event.synchronised else 0.0)
        yield from (_Planned("opened", switches[name], t, t + NEAR) for name in event.open)
        yield from (_Planned("closed", switches[name], t, latest + NEAR) for name in event.close)
        yield from (_Planned("load", load_name(loads, text), t, t + NEAR) for text in event.load)
        for name in event.leave:
            yield _Planned("left", name, start, end, f"{name} was to leave, and nobody had it leave in time")
        for name in event.join:
            yield _Planned("joined", name, start, end, f"{name} was to join, and nobody started it in time")
    (case,) = scenario.cases
    for node in netem_of(scenario, case).nodes:
        if node.kill:
            yield _Planned("died", node.name, node.from_s, inf, f"{node.name} was to be killed, and was not")
        elif node.pause:  # an agent paused for longer than Zenoh's lease counts as dead, until it goes on
            yield from (_Planned(done, node.name, node.from_s, inf) for done in ("died", "joined"))


def _departures(
    scenario: ScenarioModel, feeder: Feeder, events: Sequence[PlantEvent], meant: Sequence[Window], ended: float
) -> Iterator[PlantEvent]:
    """Yield each event that the scenario does not have, and one for each change that people left undone."""
    switches = switch_names(feeder)
    planned = [*_planned(scenario, feeder, switches, meant)]
    (case,) = scenario.cases
    netem = netem_of(scenario, case)
    faults = [entry for entries in LISTS for entry in getattr(netem, entries.name)]
    first = {row.name for row in feeder.inverters}
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
        it = next(
            (it for it in planned if (it.done, it.name) == (done, name) and it.since - NEAR <= event.t < it.until), None
        )
        if it is None:
            yield event
        elif it.complaint:
            planned.remove(it)
    for it in planned:
        if it.complaint and (it.since if it.until == inf else it.until) <= ended + NEAR:
            yield PlantEvent(t=it.since, kind="roster", subject=it.name, text=it.complaint)
