"""Agents that leave and join as a scenario says: its problems, and which inverters it has."""

from __future__ import annotations

from plant.equipment import Feeder, InverterRow
from plant.plant_config import Move
from scenarios.schema.scenario_errors import Problems
from scenarios.schema.scenario_model import Scenario
from scenarios.schema.time_checks import multiple
from wire.suggestion import suggestion


def inverters_of(scenario: Scenario, feeder: Feeder) -> tuple[InverterRow, ...]:
    """Inverters of a scenario: the feeder's, and those of its spare ones that join, in the table's order."""
    joining = {name for event in scenario.events for name in event.join}
    return (*feeder.inverters, *(row for row in feeder.spares if row.name in joining))


def moves_of(scenario: Scenario) -> tuple[Move, ...]:
    """Everybody who leaves and joins, in the order of time."""
    moves = []
    for event in scenario.events:
        moves += [Move(t=event.t_s, inverter=name, action="leave") for name in event.leave]
        moves += [Move(t=event.t_s, inverter=name, action="join") for name in event.join]
    return tuple(moves)


def check_moves(scenario: Scenario, feeder: Feeder, problems: Problems) -> None:
    """Who leaves is there then, who joins is not, and both do so at a tick."""
    present = {row.name for row in feeder.inverters}
    known = (*(row.name for row in feeder.inverters), *(row.name for row in feeder.spares))
    for i, event in enumerate(scenario.events):
        if event.leave or event.join:
            rule = "the period at which agents leave and join"
            multiple(f"event[{i}].t_s", event.t_s, "time.T_c_s", scenario.time.T_c_s, rule, problems)
        named: set[str] = set()
        for key, names in (("leave", event.leave), ("join", event.join)):
            path = f"event[{i}].{key}"
            for name in names:
                if name not in known:
                    problems.add(path, f'no inverter "{name}"; {suggestion(name, known, "inverters")}')
                elif name in named:
                    problems.add(path, f'"{name}" is named twice in event "{event.label}"; name it once')
                elif key == "leave" and name not in present:
                    problems.add(path, f'"{name}" is not there at {event.t_s:g} s; leave it out, or let it join before')
                elif key == "join" and name in present:
                    problems.add(
                        path, f'"{name}" is there already at {event.t_s:g} s; leave it out, or let it leave before'
                    )
                named.add(name)
        present = (present - set(event.leave)) | set(event.join)
