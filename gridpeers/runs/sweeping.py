"""Sweeps: one scenario, run over values of its keys, into one pandas table."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pandas as pd

from gridpeers.runs.running import warn_of_laws
from gridpeers.scenario import Scenario, as_scenario, plain
from gridpeers.scenarios.results.metric import METRICS, unit_of
from gridpeers.scenarios.schema.plugin_keys import check_portable, metrics_of
from gridpeers.scenarios.schema.scenario_errors import Problems, ScenarioError
from gridpeers.scenarios.sweep.axes import Sweep
from gridpeers.scenarios.sweep.study import results_frame
from gridpeers.scenarios.sweep.sweep_case import FATE, SweepRow, run_one
from gridpeers.scenarios.sweep.sweep_reading import BaseScenario, Plan, plan_of
from gridpeers.scenarios.sweep.workers import cores, on_workers
from gridpeers.wire.driver.command_line import pip_install
from gridpeers.wire.wording import suggestion

Values = Mapping[str, Iterable[Any]]  # Values by the dotted path of a key


def sweep(
    scenario: Scenario | str | Path,
    grid: Values | None = None,
    *,
    zip: Values | None = None,
    cases: str | Iterable[str] | None = None,
    seeds: int = 1,
    metrics: str | Iterable[Any] | None = None,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> pd.DataFrame:
    """Run a scenario over values of its keys, and return a table with a row per run.

    The columns are case, seed, the varied keys, `status` ("ran", "broke" or "law failed"), `why`, and the metrics as
    "WINDOW.METRIC" (nan without a value); without `metrics` also hashes such as `history_sha256`. Units are in `attrs`.
    A ScenarioError lists every wrong value before the first run. Raise WorkersError if a worker process ends early.

    Parameters
    ----------
    grid : Mapping[str, Iterable], optional
        Values by the dotted path of a key, as in `Scenario.replace`; every combination is run.
    zip : Mapping[str, Iterable], optional
        Keys whose values vary together, first with first.
    cases : str or list of str, optional
        Cases to run; all by default.
    seeds : int
        Number of seeds for each point: the scenario's seed and the next ones.
    metrics : list, optional
        Metrics to keep, such as `["MPSI", "t_restore_s"]`, of every window; all by default. A metric of your own is a
        function of a window, its registered name, `module:Name`, or a table with `use` and parameters.
    jobs : int, optional
        Number of processes; one per core by default. More than one needs joblib (extra `sweep`).
    progress : Callable[[int, int], None], optional
        Gets the number of finished runs and of all runs.
    """
    known = as_scenario(scenario)
    checked, chosen = _with_metrics(known, metrics)
    plan = _plan(checked, grid or {}, zip or {}, (cases,) if isinstance(cases, str) else cases or (), seeds)
    done: dict[int, SweepRow] = {}
    calls = [(number, run.scenario, run.case) for number, run in enumerate(plan.runs)]
    results = on_workers(calls, _jobs(plan, jobs), run_one)
    with closing(results):
        for row in results:
            done[row.number] = row
            if progress is not None:
                progress(len(done), len(plan.runs))
    failed = {f"run {number}": row.why for number, row in sorted(done.items()) if row.why and row.status != "broke"}
    warn_of_laws(failed, depth=1)
    frame = results_frame(plan, done).drop(columns="sample")
    if chosen is not None:
        frame = frame[_chosen(list(frame), chosen, plan)]
    frame.attrs["units"] = {name: unit for name in frame if (unit := unit_of(str(name)))}
    return frame


def _with_metrics(scenario: Scenario, metrics: str | Iterable[Any] | None) -> tuple[Scenario, list[str] | None]:
    """Return the scenario with the caller's metrics beside its own, and the names of all asked metrics."""
    if metrics is None:
        return scenario, None
    given: list[Any] = [metrics] if isinstance(metrics, str | Mapping) or callable(metrics) else list(metrics)
    there = {plugin.use: name for name, plugin in metrics_of(scenario.spec) if not plugin.parameters}
    asked = [METRICS.name_of(it) or it for it in given]
    asked = [there.get(METRICS.reference(it), it) if isinstance(it, str) else it for it in asked]
    own = [it for it in asked if not isinstance(it, str) or ":" in METRICS.reference(it)]
    if own:
        before = len(scenario.spec.metrics)
        scenario = scenario.replace({"metrics": [*scenario.spec.metrics, *own]})
        added = iter(metrics_of(scenario.spec)[before:])
        asked = [it if isinstance(it, str) and ":" not in METRICS.reference(it) else next(added)[0] for it in asked]
    return scenario, asked


def _plan(scenario: Scenario, grid: Any, zipped: Any, cases: Any, seeds: Any) -> Plan:
    problems = Problems("sweep")
    lists: dict[str, Any] = {"grid": {}, "zip": {}}
    for table, values in (("grid", grid), ("zip", zipped)):
        for path, items in values.items():
            try:
                if isinstance(items, str):
                    raise ValueError(f"needs a list of values, got {items!r}")
                lists[table][path] = [plain(item) for item in items]
            except ValueError as error:
                problems.add(f"{table}.{path}", str(error))
    problems.raise_if_any()
    request = Sweep(name=scenario.name, scenario=scenario.name, cases=tuple(cases), seeds=seeds, **lists)
    return plan_of(request, BaseScenario(scenario.tables, scenario.path, scenario.spec, scenario.feeder))


def _jobs(plan: Plan, jobs: int | None) -> int:
    """Return how many processes share the runs; definitions of a notebook are known to its own process alone."""
    lacking = find_spec("joblib") is None
    unknown = any(check_portable(run.scenario, measures=True) for run in plan.runs)
    if unknown or (lacking and jobs is None):
        return 1
    count = min(cores() if jobs is None else jobs, len(plan.runs))
    if lacking and count > 1:
        raise ScenarioError([f"jobs: more than one process needs joblib: {pip_install('sweep')}"])
    return count


def _chosen(columns: list[str], metrics: list[str], plan: Plan) -> list[str]:
    head = [name for name in columns if name in ("case", "seed", "status", "why", *plan.parameters)]
    head += [name for name in columns if name == "metric_warnings"]
    known = dict.fromkeys(name.partition(".")[2] or name for name in columns if name not in (*head, *FATE))
    several = {name.partition(".")[0] for name in known}
    if known and (unknown := [name for name in metrics if name not in known and name not in several]):
        raise ScenarioError(f'metrics: no metric "{name}"; {suggestion(name, known, "metrics")}' for name in unknown)
    asked = {name for name in known if name in metrics or name.partition(".")[0] in metrics}
    return head + [name for name in columns if (name.partition(".")[2] or name) in asked and name not in head]
