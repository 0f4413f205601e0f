"""When agents really left and joined: in wall-clock time a process takes its time to come up."""

from __future__ import annotations

from collections.abc import Iterable

from scenarios.schema.scenario_model import ScenarioModel
from wire.messages import PlantEvent


def as_they_came(scenario: ScenarioModel, recorded: Iterable[PlantEvent]) -> list[tuple[str, float]]:
    """Return label and time (s) of each event of a scenario: the scenario's, or that at which the last inverter moved.

    What a window measures begins with what happened, so that neither "within 1 s of returning" counts the start of a
    process, nor the time of its start is lost: the events tell both. In simulated time the two are the same.

    Parameters
    ----------
    scenario : ScenarioModel
        What was to happen.
    recorded : Iterable[PlantEvent]
        What the plant told.
    """
    moved = [(event.t, event.subject) for event in recorded if event.kind == "inverter"]
    ends = [*(event.t_s for event in scenario.events), scenario.time.end_s][1:]
    came = []
    for event, end in zip(scenario.events, ends, strict=True):
        names = {*event.leave, *event.join}
        times = [t for t, name in moved if name in names and event.t_s - 1e-9 <= t < end]
        came.append((event.label, max(times, default=event.t_s)))
    return came


def late_moves(scenario: ScenarioModel, recorded: Iterable[PlantEvent]) -> list[str]:
    """Return sentences on events that came later than the scenario says, as processes, or people, took their time."""
    came = as_they_came(scenario, recorded)
    return [
        f"{event.label}, meant for t = {event.t_s:g} s, came at {t:g} s, when the last of its agents had moved; "
        "what is measured of it begins there"
        for event, (_, t) in zip(scenario.events, came, strict=True)
        if t > event.t_s + 1e-9
    ]
