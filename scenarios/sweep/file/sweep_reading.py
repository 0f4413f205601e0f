"""From a name or a path to a checked plan of runs, or to all that is wrong with it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import msgspec

from gridpeers.scenarios.catalogue_files import SWEEPS, names_in
from gridpeers.scenarios.duration import duration
from gridpeers.scenarios.schema import ScenarioError, ScenarioModel, find_scenario, load_scenario
from gridpeers.scenarios.schema.loading import find_file, read_toml
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.sweep.file.axes import Axis, graph_axes, grid_axes, of_values, samples, zip_axes
from gridpeers.scenarios.sweep.file.paths import PathError, flatten, steps
from gridpeers.scenarios.sweep.file.plan import Plan, fingerprint
from gridpeers.scenarios.sweep.file.random_axis import random_axes
from gridpeers.scenarios.sweep.file.samples import BaseScenario, checked_runs
from gridpeers.scenarios.sweep.file.sweep_model import Sweep
from gridpeers.wire.schema.relations import problems_of
from gridpeers.wire.schema.suggestion import suggestion

SECONDS_PER_SECOND = 0.05
"""Rough cost of a second of the nine-inverter feeder (s on one core, bench/peers), for messages alone."""


def sweeps() -> tuple[str, ...]:
    """Return the names of the sweeps that come with gridpeers."""
    return names_in(SWEEPS)


def read_sweep(name: str | Path) -> Plan:
    """Read a sweep and check every sample's scenario before anything is started.

    Raises
    ------
    ScenarioError
        With every problem of the sweep file, of its scenario and of its samples.

    Examples
    --------
    >>> plan = read_sweep("gains")
    >>> plan.base.name, plan.parameters
    ('islanding', ('gains.k_p', 'gains.k_q'))
    """
    path = find_file(str(name), SWEEPS, "sweep")
    text, data = read_toml(path)
    problems = Problems(path.name, text)
    sweep = problems.read(Sweep, data)
    axes = _own_axes(sweep, problems)
    base = _base(sweep, path, problems)
    return _plan(msgspec.structs.replace(sweep, name=sweep.name or path.stem), text, axes, base, problems)


def plan_of(sweep: Sweep, base: BaseScenario) -> Plan:
    """Check a sweep that is made in Python.

    Raises
    ------
    ScenarioError
        With every problem of the sweep and of its samples.
    """
    problems = Problems("sweep")
    return _plan(sweep, "", _own_axes(sweep, problems), base, problems)


def _own_axes(sweep: Sweep, problems: Problems) -> list[Axis]:
    """Return the axes that need no scenario, the slowest first, and note the file's own problems."""
    for problem in problems_of(sweep):
        problems.add(*problem)
    axes = [*grid_axes(sweep.grid, problems), *zip_axes(sweep.zip, problems), *random_axes(sweep.random, problems)]
    if not (axes or sweep.graph.links or sweep.seeds > 1):
        problems.add("", "nothing is varied; write a table [grid], [zip], [random] or [graph], or seeds = n")
    return axes


def _base(sweep: Sweep, path: Path, problems: Problems) -> BaseScenario:
    """Return the scenario that is varied; without it nothing more can be checked, and all that was noted is raised."""
    beside = path.parent / sweep.scenario
    try:
        base = beside if sweep.scenario and beside.is_file() else find_scenario(sweep.scenario)
        return BaseScenario(read_toml(base)[1], base, *load_scenario(base))
    except ScenarioError as error:
        if not problems.touch("scenario"):
            for problem in error.problems:
                problems.add("scenario", problem)
        problems.raise_if_any()
        raise


def _plan(sweep: Sweep, text: str, axes: Sequence[Axis], base: BaseScenario, problems: Problems) -> Plan:
    """Check every sample of a sweep, and make its runs."""
    scenario = base.scenario
    cases = _cases(sweep, scenario, problems)
    names = [row.name for row in inverters_of(scenario, base.feeder)]
    fixed = dict(flatten(sweep.set))
    axes = [*axes, *graph_axes(sweep.graph, names, cases, problems)]
    if sweep.seeds > 1:
        seeds = range(scenario.seed, scenario.seed + sweep.seeds)
        axes.append(Axis({"seed": "seeds"}, lambda: of_values({"seed": seeds})))
    origin = _origins([Axis({path: f"set.{path}" for path in fixed}, lambda: ()), *axes], problems)
    points = [] if problems.any else [axis.settings() for axis in axes]
    count = math.prod(map(len, points))
    size = count * len(cases)
    settings = list(islice(samples(points), count if size <= sweep.max_runs else 1))
    runs, feeders = checked_runs(base, fixed, settings, cases, origin, problems)
    if size > sweep.max_runs > 0:
        end_s = (runs[0].scenario if runs else scenario).time.end_s
        problems.add(
            "max_runs",
            f"this is {size:,} runs, about {duration(size * SECONDS_PER_SECOND * end_s)} on one core, and more than "
            f"max_runs = {sweep.max_runs:,}; thin out the axes, or raise max_runs if it is meant",
        )
    problems.raise_if_any()
    return Plan(
        name=sweep.name,
        title=sweep.title,
        text=text,
        base=scenario,
        runs=tuple(runs),
        fingerprint=fingerprint(runs, feeders),
    )


def _cases(sweep: Sweep, scenario: ScenarioModel, problems: Problems) -> tuple[str, ...]:
    for case in sweep.cases:
        if case not in scenario.cases:
            problems.add("cases", f'no case "{case}"; {suggestion(case, scenario.cases, "cases")}')
    chosen = tuple(case for case in scenario.cases if case in sweep.cases)
    return chosen or tuple(scenario.cases)


def _origins(axes: Sequence[Axis], problems: Problems) -> dict[str, str]:
    """Return the key of the sweep file by key of the scenario; a key that is set in two ways is a problem."""
    found: dict[str, str] = {}
    for key, where in (item for axis in axes for item in axis.origin.items()):
        try:
            steps(key)
        except PathError as error:
            problems.add(where, str(error))
        if key in found:
            problems.add(where, f"{key} is set by {found[key]} already; leave one of them out")
        found.setdefault(key, where)
    return found
