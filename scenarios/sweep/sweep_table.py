"""The results of a sweep: a pandas table with a row per run, and the Parquet file with every parameter and index.

Rows are in the order of the plan whatever order they were finished in, and columns depend on the plan and the rows
alone; so the same sweep gives an equal table, undisturbed or resumed, here or on a cluster.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.sweep.column_labels import unit_of
from gridpeers.scenarios.sweep.file import Plan
from gridpeers.scenarios.sweep.sweep_case import FATE, SweepRow
from gridpeers.scenarios.versions import versions

FILE = "results.parquet"


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


def as_written(frame: pd.DataFrame, plan: Plan) -> pd.DataFrame:
    """Return the table with parameters that are neither numbers nor texts as JSON."""
    mixed = [name for name in plan.parameters if frame[name].dtype == object]
    return frame.assign(**{name: [json.dumps(value, default=str) for value in frame[name]] for name in mixed})


def write_table(frame: pd.DataFrame, plan: Plan, folder: Path) -> Path:
    """Write a table at once or not at all.

    Each column's metadata has its unit; the file's has the sweep file, the base scenario with all defaults, and the
    versions.
    """
    import pyarrow as pa  # of the extra `sweep`; a sweep in Python does without
    import pyarrow.parquet as pq

    types = {name: pa.from_numpy_dtype(of) if of.kind in "bif" else pa.string() for name, of in frame.dtypes.items()}
    units = {name: {"unit": unit_of(name)} if unit_of(name) else None for name in frame}
    schema = pa.schema([pa.field(name, types[name], metadata=units[name]) for name in frame])
    about = {
        "gridpeers.sweep": plan.text,
        "gridpeers.scenario": to_toml(plan.base, {}),
        "gridpeers.fingerprint": plan.fingerprint,
        "gridpeers.versions": json.dumps(versions()),
    }
    path = folder / FILE
    partial = path.with_name(FILE + ".partial")
    table = pa.Table.from_pandas(frame, schema=schema, preserve_index=False).replace_schema_metadata(about)
    pq.write_table(table, partial)
    partial.replace(path)
    return path
