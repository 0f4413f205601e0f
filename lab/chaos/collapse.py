"""Collapses that come so soon after a change of the network that no control prevents them, and what they excuse."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from gridpeers.lab.chaos.chaos_checks import RESTORED
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.connectivity import bus_islands
from gridpeers.scenarios.checks.check_verdict import SHOWN_VIOLATIONS, CheckVerdict
from gridpeers.scenarios.results.island_membership import closed_switches
from gridpeers.scenarios.results.recorded_events import tripped_by
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.messages import PlantEvent

PERIODS = 2
"""Control periods after a change within which trips are a collapse. The first measurement that shows the change is
taken at the end of the first period. What an agent decides on it acts during the second one, before any agent has heard
of the change from another, or has measured what a decision did."""


class Collapse(NamedTuple):
    label: str
    text: str
    inverters: frozenset[str]
    """Inverters of the islands in which inverters tripped, as the switches were then."""


def collapses_at_changes(scenario: ScenarioModel, feeder: Feeder, events: Iterable[PlantEvent]) -> tuple[Collapse, ...]:
    """Return the collapses of a run, one for each change that makes inverters trip within `PERIODS`.

    The first trip of an inverter counts alone: who has tripped before may trip again for the reason of that time.
    """
    rows = (*feeder.inverters, *feeder.spares)
    bus_of = {row.name: row.bus for row in rows}
    longest = PERIODS * scenario.time.T_c_s + 1e-9
    switched: list[PlantEvent] = []
    tripped: set[str] = set()
    found: dict[str, Collapse] = {}
    for event in events:
        if event.kind == "switch":
            switched.append(event)
        first = set(tripped_by(event)) - tripped
        tripped |= first
        since = [change.label for change in scenario.events if -1e-9 <= event.t - change.t_s <= longest]
        if not first or not since:
            continue
        label, buses = since[-1], {bus_of[name] for name in first}
        islands = [each for each in bus_islands(feeder, closed_switches(feeder, switched)) if each & buses]
        members = frozenset(row.name for row in rows if any(row.bus in island for island in islands))
        before = found.get(label, Collapse(label, f"{label}: at t = {event.t:g} s {event.text}", frozenset()))
        found[label] = before._replace(inverters=before.inverters | members)
    return tuple(found.values())


def unexcused(verdicts: Iterable[CheckVerdict], excused: frozenset[str]) -> dict[str, str]:
    """Return the failed checks of what control restores, with the sentence of what inverters violate that count.

    A sentence is empty if only excused inverters violate the check. A violation that names no inverter counts.
    """
    found = {}
    for verdict in verdicts:
        if verdict.status == "failed" and verdict.check in RESTORED:
            rest = tuple(violation for violation in verdict.violations if violation.agent not in excused)
            count = verdict.count - len(verdict.violations) + len(rest)
            beyond = "" if rest else f"{count} violations, beyond the {SHOWN_VIOLATIONS} that a verdict keeps"
            reason = verdict.reason or beyond
            of_others = msgspec.structs.replace(verdict, violations=rest, count=count, reason=reason)
            found[verdict.check] = of_others.sentence if count or verdict.reason else ""
    return found
