"""Times of a scenario that fall on the grid of a step, in their order, and steps short enough for the inverters."""

from __future__ import annotations

from itertools import pairwise

from gridpeers.plant.equipment import Feeder
from gridpeers.plant.equipment.inverter_parameters import GfmParameters
from gridpeers.plant.equipment.own_parameters import InverterParameters, given
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.wire.schema.relations import MultipleOf

PART_OF_T = {"first-order": 0.3, "second-order": 1.0}
"""Longest integration step of a method, as a part of the inverters' shortest time constant: at 0.4 of it the first
rings on microgrid123; the second is stable up to 2 of it."""


def check_times(scenario: ScenarioModel, problems: Problems) -> None:
    """Note times off the grid that they belong to, and events that are not in the order of time."""
    time = scenario.time
    paths = [f"event[{i}].t_s" for i in range(len(scenario.events))]
    read = {path for path in paths if not problems.touch(path)}  # a time off its grid is a time nevertheless
    for i, event in enumerate(scenario.events):
        path = f"event[{i}].t_s"
        multiple(path, event.t_s, "time.h_s", time.h_s, "the step of the plant", problems)
        if path in read and event.t_s >= time.end_s > 0:  # a missing end is 0
            problems.add(
                path,
                f'event "{event.label}" at {event.t_s:g} s does not come before the end at {time.end_s:g} s; '
                "move it, or raise end_s",
            )
    for i, (first, second) in enumerate(pairwise(scenario.events)):
        path, gap = f"event[{i + 1}].t_s", second.t_s - first.t_s
        if not {f"event[{i}].t_s", path} <= read:
            continue
        if gap <= 0:
            problems.add(
                path,
                f'event "{second.label}" at {second.t_s:g} s is written after "{first.label}" at {first.t_s:g} s; '
                "write events in the order of time, and what happens at once as one event",
            )
        elif not problems.touch("time.record_s") and gap < 1.5 * time.record_s:
            problems.add(
                path,
                f'event "{second.label}" follows "{first.label}" by {gap:g} s, so that no recorded row lies between '
                f"them to measure; write them as one event, or lower record_s = {time.record_s:g} s",
            )


def check_step(scenario: ScenarioModel, feeder: Feeder | None, problems: Problems) -> None:
    """Note an integration step that does not resolve every time constant of the inverters."""
    gfm, gfl = scenario.plant.gfm, scenario.plant.gfl
    of = _time_constants("plant.gfm", gfm) | _time_constants("plant.gfl", gfl)
    if feeder:
        for row in (*feeder.inverters, *feeder.spares):
            if row.parameters or given(row.own):
                of |= _time_constants(f"plant.inverter.{row.name}", feeder.parameters_of(row, gfm, gfl))
    (table, name), least = min(of.items(), key=lambda item: item[1])
    part, h = PART_OF_T[scenario.time.method], scenario.time.h_s
    most = part * least
    if problems.touch("time.h_s", f"{table}.{name}_s") or h <= most * (1.0 + 1e-9):
        return
    problems.add(
        "time.h_s",
        f"{h:g} s is too long a step for {name}_s = {least:g} s of [{table}], which it would not resolve; "
        f"at most {most:g} s, {part:g} of the shortest time constant",
    )


def _time_constants(table: str, parameters: InverterParameters) -> dict[tuple[str, str], float]:
    """Return the time constants (s) that an inverter's step must resolve, by table and name."""
    if isinstance(parameters, GfmParameters):
        names: tuple[str, ...] = ("T_p", "T_q", "T_v")
    else:
        names = ("T_ff", "T_pf", "T_vf", "T_qf", *(("T_if",) if parameters.model == "current_source" else ()))
    return {(table, name): getattr(parameters, name) for name in names}


def multiple(path: str, value: float, of: str, step: float, rule: str, problems: Problems) -> None:
    """Note a time (s) that is no whole multiple of a step (s).

    Parameters
    ----------
    path, of : str
        Keys of the time and of the step; where a problem is noted at one of them, nothing is said.
    value, step : float
        Both (s).
    rule : str
        What takes place at such times, as an end of the sentence.
    problems : Problems
        Takes the problem.
    """
    if not problems.touch(path, of) and (text := MultipleOf(of).objection(value, step, of.rpartition(".")[2], rule)):
        problems.add(path, text)
