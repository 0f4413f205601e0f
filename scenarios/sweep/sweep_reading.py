"""Read a sweep by name or path, and return its checked plan of runs or all its errors."""

from __future__ import annotations

import copy
import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.catalogue_files import SWEEPS, names_in
from gridpeers.scenarios.schema import ScenarioError, ScenarioModel, find_scenario, load_scenario
from gridpeers.scenarios.schema.loading import check_tables, find_file, read_toml
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.sweep.axes import Axis, Setting, Sweep, axis_of, graph_axes, own_axes, samples
from gridpeers.scenarios.sweep.paths import PathError, Tree, flatten, put, steps
from gridpeers.wire.schema.table_schema import problems_of


@dataclass(frozen=True)
class Run:
    sample: int
    """Number of the sample, from 0, in the order of the axes."""
    case: str
    scenario: ScenarioModel
    shown: Mapping[str, Any]
    """The sample's value of each parameter."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    name: str
    title: str
    text: str
    base: ScenarioModel
    runs: Sequence[Run]
    fingerprint: str
    """SHA-256 of everything that decides the runs: scenarios, feeders, order. Two sweeps with one are the same."""

    @property
    def parameters(self) -> tuple[str, ...]:
        return tuple(self.runs[0].shown)


MOST_LISTED = 20  # Most problems of samples in a message: the rest is more of the same


class BaseScenario(NamedTuple):
    tree: Tree
    path: Path
    """Its file: relative paths start there."""
    scenario: ScenarioModel
    feeder: Tables


def checked_runs(
    base: BaseScenario,
    fixed: Mapping[str, Any],
    settings: Sequence[Setting],
    cases: Sequence[str],
    origin: Mapping[str, str],
    problems: Problems,
) -> tuple[list[Run], Sequence[Tables]]:
    """Check every sample, and return its runs and all feeders; both are of use only when no problem is noted.

    Each problem is noted at its `origin`, the key of the sweep file by key of the scenario.
    """
    runs: list[Run] = []
    feeders: dict[tuple[str, str], Tables] = {}
    wrong: dict[tuple[str, str], list[int]] = {}
    reader = lru_cache(maxsize=None)(read_feeder)
    for i, setting in enumerate(settings):
        tree, noted = copy.deepcopy(base.tree), Problems("")
        for path, value in {**fixed, **setting.put}.items():
            try:
                put(tree, path, copy.deepcopy(value))
            except PathError as error:
                noted.add(path, str(error))
        scenario, feeder = check_tables(tree, base.path, noted, reader)
        if not scenario.events and not noted.touch("event"):
            noted.add("event", "the scenario has no [[event]], and only what follows an event is measured; write one")
        for problem in noted.noted:
            wrong.setdefault(problem, []).append(i)
        if not noted.noted and feeder is not None:
            feeders[scenario.plant.feeder, scenario.plant.load_set] = feeder
            chosen = msgspec.structs.replace(scenario, cases={case: scenario.cases[case] for case in cases})
            runs += [Run(i, case, chosen, setting.shown) for case in cases]
    for (path, text), numbers in list(wrong.items())[:MOST_LISTED]:
        around = [key for key in origin if path == key or path.startswith((f"{key}.", f"{key}["))]
        at = origin[max(around, key=len)] if around else path
        inside = f"{path}: " if path and not at.endswith(path) else ""
        problems.add(at, inside + text + _in_samples(numbers, settings))
    if len(wrong) > MOST_LISTED:
        problems.add("", f"and {len(wrong) - MOST_LISTED} more problems of this kind in other samples")
    return runs, tuple(feeders.values())


def _in_samples(numbers: Sequence[int], settings: Sequence[Setting]) -> str:
    """Return which samples a problem is in, with the values of the first."""
    count = len(settings)
    if len(numbers) == count:
        return f" (in all {count} samples)" if count > 1 else ""
    values = settings[numbers[0]].shown
    listed = ", ".join(f"{key} = {json.dumps(value)}" for key, value in values.items() if key != "graph.edges")
    more = f"; and in {len(numbers) - 1} more of {count}" if len(numbers) > 1 else ""
    return f" (sample {numbers[0]}: {listed}{more})"


def sweeps() -> tuple[str, ...]:
    return names_in(SWEEPS)


def sweep_title(name: str) -> str:
    """Return the title of a sweep of the catalogue, without checking its runs."""
    return str(read_toml(SWEEPS / f"{name}.toml")[1]["title"])


def read_sweep(name: str | Path) -> Plan:
    """Read a sweep; ScenarioError has every problem of its file, its scenario and its samples."""
    path = find_file(str(name), SWEEPS, "sweep")
    text, data = read_toml(path)
    problems = Problems(path.name, text)
    sweep = problems.read(Sweep, data)
    axes = _own_axes(sweep, problems)
    base = _base(sweep, path, problems)
    return _plan(msgspec.structs.replace(sweep, name=sweep.name or path.stem), text, axes, base, problems)


def plan_of(sweep: Sweep, base: BaseScenario) -> Plan:
    """Check a sweep that is made in Python; ScenarioError has every problem of it and of its samples."""
    problems = Problems("sweep")
    return _plan(sweep, "", _own_axes(sweep, problems), base, problems)


def _own_axes(sweep: Sweep, problems: Problems) -> list[Axis]:
    for problem in problems_of(sweep):
        problems.add(*problem)
    axes = own_axes(sweep, problems)
    if not (axes or sweep.graph.links or sweep.seeds > 1):
        problems.add("", "nothing is varied; write a table [grid], [zip] or [graph], or seeds = n")
    return axes


def _base(sweep: Sweep, path: Path, problems: Problems) -> BaseScenario:
    """Return the scenario that is varied; without it all that was noted is raised."""
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
    scenario = base.scenario
    for case in sweep.cases:
        problems.unknown("cases", "case", case, scenario.cases)
    cases = tuple(case for case in scenario.cases if case in sweep.cases) or tuple(scenario.cases)
    names = [row.name for row in inverters_of(scenario, base.feeder)]
    fixed = dict(flatten(sweep.set))
    axes = [*axes, *graph_axes(sweep.graph, names, cases, problems)]
    if sweep.seeds > 1:
        seeds = range(scenario.seed, scenario.seed + sweep.seeds)
        axes.append(axis_of({"seed": seeds}, {"seed": "seeds"}))
    origin = _origins([Axis({path: f"set.{path}" for path in fixed}, ()), *axes], problems)
    points = [] if problems.any else [axis.settings for axis in axes]
    count = math.prod(map(len, points))
    size = count * len(cases)
    settings = list(islice(samples(points), count if size <= sweep.max_runs else 1))
    runs, feeders = checked_runs(base, fixed, settings, cases, origin, problems)
    if size > sweep.max_runs > 0:
        problems.add(
            "max_runs",
            f"this is {size:,} runs, and more than max_runs = {sweep.max_runs:,}; thin out the axes, or raise max_runs "
            "if it is meant",
        )
    problems.raise_if_any()
    whole = hashlib.sha256()
    for run in runs:
        whole.update(msgspec.json.encode((run.sample, run.case, run.scenario, dict(run.shown))))
    for feeder in sorted(map(repr, feeders)):
        whole.update(feeder.encode())
    name, title, mark = sweep.name, sweep.title, whole.hexdigest()
    return Plan(name=name, title=title, text=text, base=scenario, runs=tuple(runs), fingerprint=mark)


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
