"""From a name or a path to a checked plan of runs, or to all that is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import msgspec

from plant.equipment import Feeder
from scenarios.catalogue_files import SWEEPS, names_in
from scenarios.duration import duration
from scenarios.schema import Scenario, ScenarioError, find_scenario, load_scenario
from scenarios.schema.agent_schedule import inverters_of
from scenarios.schema.file_lookup import find_file
from scenarios.schema.loading import read_toml
from scenarios.schema.scenario_errors import Problems
from scenarios.sweep.file import axes as of
from scenarios.sweep.file.axes import Axis, check_graph, check_zip, of_graphs, of_values, values_of
from scenarios.sweep.file.paths import PathError, Tree, flatten, steps
from scenarios.sweep.file.plan import SECONDS_PER_SECOND, Plan, fingerprint
from scenarios.sweep.file.random_axis import Law, check_random, laws_of, of_laws
from scenarios.sweep.file.samples import Samples
from scenarios.sweep.file.sweep_model import Sweep
from wire.suggestion import suggestion
from wire.table_schema import problems_of


def sweeps() -> tuple[str, ...]:
    """Names of the sweeps that come with gridpeers."""
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
    laws = _check(sweep, problems)
    base, scenario, feeder = _base(sweep, path, problems)
    named = msgspec.structs.replace(sweep, name=sweep.name or path.stem)
    return _plan(named, text, laws, Base(read_toml(base)[1], base, scenario, feeder), problems)


class Base(NamedTuple):
    """The scenario that is varied."""

    tree: Tree
    """Its tables."""
    path: Path
    """Its file: relative paths start there."""
    scenario: Scenario
    """Checked."""
    feeder: Feeder
    """Its feeder."""


def plan_of(sweep: Sweep, base: Base) -> Plan:
    """Check a sweep that is made in Python.

    Raises
    ------
    ScenarioError
        With every problem of the sweep and of its samples.
    """
    problems = Problems("sweep")
    laws = _check(sweep, problems)
    return _plan(sweep, "", laws, base, problems)


def _plan(sweep: Sweep, text: str, laws: dict[str, Law], base: Base, problems: Problems) -> Plan:
    """Check every sample of a sweep, and make its runs."""
    scenario, feeder = base.scenario, base.feeder
    cases = _cases(sweep, scenario, problems)
    names = [row.name for row in inverters_of(scenario, feeder)]
    check_graph(sweep.graph, names, problems)
    origin = _origins(sweep, laws, cases, problems)
    axes = [] if problems.any else _axes(sweep, laws, scenario, names, cases)
    count = of.size(axes)
    size = count * len(cases)
    checked = count if size <= sweep.max_runs else 1
    samples = Samples(base.tree, base.path, dict(flatten(sweep.set, lambda value: False)), cases)
    runs = samples.runs(islice(of.samples(axes), checked))
    samples.tell(origin, problems, checked)
    _check_size(sweep, size, runs[0].scenario if runs else scenario, problems)
    problems.raise_if_any()
    return Plan(
        name=sweep.name,
        title=sweep.title,
        text=text,
        base=scenario,
        runs=tuple(runs),
        fingerprint=fingerprint(runs, samples.feeders.values()),
    )


def _check(sweep: Sweep, problems: Problems) -> dict[str, Law]:
    """What is wrong with the file by itself; the laws that it draws by."""
    for problem in problems_of(sweep):
        problems.add(*problem)
    values_of(sweep.grid, "grid", problems)
    check_zip(values_of(sweep.zip, "zip", problems), problems)
    check_random(sweep.random, problems)
    if not (sweep.grid or sweep.zip or sweep.random.keys or sweep.graph.links or sweep.seeds > 1):
        problems.add("", "nothing is varied; write a table [grid], [zip], [random] or [graph], or seeds = n")
    return laws_of(sweep.random, problems)


def _base(sweep: Sweep, path: Path, problems: Problems) -> tuple[Path, Scenario, Feeder]:
    """The scenario that is varied. Without it nothing more can be checked: what was found until here is told then."""
    beside = path.parent / sweep.scenario
    try:
        base = beside if sweep.scenario and beside.is_file() else find_scenario(sweep.scenario)
        return base, *load_scenario(base)
    except ScenarioError as error:
        if not problems.touch("scenario"):
            for problem in error.problems:
                problems.add("scenario", problem)
        problems.raise_if_any()
        raise


def _cases(sweep: Sweep, scenario: Scenario, problems: Problems) -> tuple[str, ...]:
    for case in sweep.cases:
        if case not in scenario.cases:
            problems.add("cases", f'no case "{case}"; {suggestion(case, scenario.cases, "cases")}')
    chosen = tuple(case for case in scenario.cases if case in sweep.cases)
    return chosen or tuple(scenario.cases)


def _origins(sweep: Sweep, laws: Mapping[str, Law], cases: Sequence[str], problems: Problems) -> dict[str, str]:
    """Key of the sweep file by key of the scenario; a key that is set in two ways is a problem."""
    found: dict[str, str] = {}
    for key, where in _keys(sweep, laws, cases):
        try:
            steps(key)
        except PathError as error:
            problems.add(where, str(error))
        if key in found:
            problems.add(where, f"{key} is set by {found[key]} already; leave one of them out")
        found.setdefault(key, where)
    return found


def _keys(sweep: Sweep, laws: Mapping[str, Law], cases: Sequence[str]) -> Iterator[tuple[str, str]]:
    silent = Problems("")  # they were told when the file was checked
    for table, keys in (
        ("set", dict(flatten(sweep.set, lambda value: False))),
        ("grid", values_of(sweep.grid, "grid", silent)),
        ("zip", values_of(sweep.zip, "zip", silent)),
        ("random.keys", laws),
    ):
        yield from ((key, f"{table}.{key}") for key in keys)
    if sweep.graph.links:
        yield from ((f"case.{case}.{key}", "graph") for case in cases for key in ("graph", "links"))
    if sweep.seeds > 1:
        yield "seed", "seeds"


def _axes(
    sweep: Sweep, laws: Mapping[str, Law], scenario: Scenario, names: Sequence[str], cases: Sequence[str]
) -> list[Axis]:
    """The axes in the order of the table's columns, the slowest first."""
    silent = Problems("")
    axes = [of_values({path: values}) for path, values in values_of(sweep.grid, "grid", silent).items()]
    if sweep.zip:
        axes.append(of_values(values_of(sweep.zip, "zip", silent)))
    if laws:
        axes.append(of_laws(sweep.random, laws))
    if sweep.graph.links:
        axes.append(of_graphs(sweep.graph, names, cases))
    if sweep.seeds > 1:
        axes.append(of_values({"seed": range(scenario.seed, scenario.seed + sweep.seeds)}))
    return axes


def _check_size(sweep: Sweep, runs: int, scenario: Scenario, problems: Problems) -> None:
    if runs > sweep.max_runs > 0:
        time = duration(runs * SECONDS_PER_SECOND * scenario.time.end_s)
        problems.add(
            "max_runs",
            f"this is {runs:,} runs, about {time} on one core, and more than max_runs = {sweep.max_runs:,}; thin out "
            "the axes, or raise max_runs if it is meant",
        )
