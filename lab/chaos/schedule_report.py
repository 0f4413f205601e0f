"""A schedule in sentences: its disturbances in the order of time, and which of them meet an agent that is away.

A schedule is drawn disturbance by disturbance, so a lie, a pause or a kill may be planned for an agent that has left
before. A scenario may say that, and nothing happens then.
"""

from __future__ import annotations

from gridpeers.lab.chaos.disturbance import Disturbance, Schedule
from gridpeers.lab.chaos.disturbed_scenario import ChaosBase, merged_events
from gridpeers.scenarios.schema.check_notes import AgentEvent, why_away
from gridpeers.scenarios.schema.participants import inverters_of


def schedule_lines(base: ChaosBase, schedule: Schedule) -> list[str]:
    """Return a sentence for each disturbance, in the order of time, with why nothing happens where that is so."""
    lines = []
    for disturbance in sorted(schedule, key=lambda it: it.begins_s):
        why = _why_idle(base, schedule, disturbance)
        lines.append(f"{disturbance} (nothing happens: {why})" if why else str(disturbance))
    return lines


def effective(base: ChaosBase, schedule: Schedule) -> Schedule:
    """Return the disturbances of a schedule without those that only meet an agent that is away."""
    return tuple(it for it in schedule if not _why_idle(base, schedule, it))


def _why_idle(base: ChaosBase, schedule: Schedule, disturbance: Disturbance) -> str:
    """Return why a disturbance of an agent has no effect; "" if it may have one, and of any other."""
    if disturbance.table != "node":
        return ""
    name = str(disturbance.entry["name"])
    events = merged_events(base.tree.get("event", ()), schedule)
    agent_events = [AgentEvent(float(it["t_s"]), it.get("leave", ()), it.get("join", ())) for it in events]
    at_start = any(row.name == name and not row.spare for row in inverters_of(base.scenario, base.feeder))
    why = why_away(name, disturbance.begins_s, disturbance.ends_s, agent_events, at_start=at_start)
    return f"{name} {why}" if why else ""
