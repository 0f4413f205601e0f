"""The table of a sweep, and the units of its columns."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from gridpeers.scenarios.results.run_files import write_whole
from gridpeers.scenarios.sweep.sweep_case import FATE, SweepRow
from gridpeers.scenarios.sweep.sweep_reading import Plan

_UNITS = ("s", "Hz", "pu", "kW", "kvar", "W", "var", "V")


def unit_of(name: str) -> str:
    """Return the unit of a column, with which the name of a key or an index ends."""
    *above, last = name.split(".")
    if last == "V_error" or above[-1:] == ["p"]:
        return "pu"
    rest, _, unit = last.rpartition("_")
    return unit if rest and unit in _UNITS else ""


FILE = "results.csv"


def results_frame(plan: Plan, done: Mapping[int, SweepRow]) -> pd.DataFrame:
    """Return the rows of the runs that are done.

    Columns: `sample`, `case`, `seed`, the parameters by their path, those of `FATE` (`metric_warnings` only where the
    scenario has metrics of its own), the indexes as "WINDOW.INDEX", nan where there is no value, and over emulated
    links `links_sent`, `links_delivered`, `links_dropped`.
    """
    numbers = sorted(done)
    runs, rows = [plan.runs[number] for number in numbers], [done[number] for number in numbers]
    columns: dict[str, list[object]] = {
        "sample": [run.sample for run in runs],
        "case": [run.case for run in runs],
        "seed": [run.scenario.seed for run in runs],
    }
    columns |= {name: [run.shown[name] for run in runs] for name in plan.parameters if name not in columns}
    fate = FATE if any(run.scenario.metrics for run in runs) else FATE[:-1]
    columns |= {name: [getattr(row, name) or None for row in rows] for name in fate}
    measures = pd.DataFrame([row.measures for row in rows], dtype=float)
    return pd.concat([pd.DataFrame(columns), measures], axis=1)


def write_table(frame: pd.DataFrame, plan: Plan, folder: Path) -> Path:
    """Write a table at once or not at all; a parameter whose values are no numbers alone is JSON."""
    mixed = [name for name in plan.parameters if frame[name].dtype == object]
    written = frame.assign(**{name: [json.dumps(value, default=str) for value in frame[name]] for name in mixed})
    write_whole(folder / FILE, written.to_csv(index=False))
    return folder / FILE
