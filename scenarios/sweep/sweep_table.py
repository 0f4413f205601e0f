"""The table of a sweep: one Parquet file with every parameter, every index and the fate of every run.

Rows are in the order of the plan whatever order they were finished in, and columns depend on the plan and the rows
alone; so the same sweep gives an equal table, undisturbed or resumed, here or on a cluster.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarios.run import versions
from scenarios.schema.scenario_writing import to_toml
from scenarios.sweep.column_labels import unit_of
from scenarios.sweep.file import Plan
from scenarios.sweep.sweep_case import FATE, SweepRow, columns_of

FILE = "results.parquet"


def table_of(plan: Plan, done: Mapping[int, SweepRow]) -> pa.Table:
    """Return the rows of the runs that are done.

    Columns: `sample`, `case`, `seed`, the parameters by their path, `status` ("ran" or "broke"), `why`,
    `trips`, `link_warnings`, `history_sha256`, `links_sha256`, the indexes as "WINDOW.INDEX", and over emulated links
    `links_sent`, `links_delivered`, `links_dropped`. The metadata holds the sweep file, the base scenario with all
    defaults, and the versions; each column's has its unit.
    """
    columns = {name: _array(name, values, plan) for name, values in columns_of(plan, done).items()}
    fields = [pa.field(name, column.type, metadata=_metadata(name)) for name, column in columns.items()]
    about = {
        "gridpeers.sweep": plan.text,
        "gridpeers.scenario": to_toml(plan.base, {}),
        "gridpeers.fingerprint": plan.fingerprint,
        "gridpeers.versions": json.dumps(versions()),
    }
    return pa.table(list(columns.values()), schema=pa.schema(fields, metadata=about))


def write_table(table: pa.Table, folder: Path) -> Path:
    """Write the table at once or not at all."""
    path = folder / FILE
    partial = path.with_name(FILE + ".partial")
    pq.write_table(table, partial)
    partial.replace(path)
    return path


def _array(name: str, values: Sequence[Any], plan: Plan) -> pa.Array:
    """Return a column with the type that it has in every sweep."""
    if name in ("sample", "seed"):
        return pa.array(values, pa.int64())
    if name == "case" or name in FATE:
        return pa.array(values, pa.string())
    return _column(values) if name in plan.parameters else pa.array(values, pa.float64())


def _column(values: Sequence[Any]) -> pa.Array:
    """Return the values of a parameter: numbers and texts as such, what is neither as JSON."""
    kinds = {type(value) for value in values}
    if kinds <= {bool}:
        return pa.array(values, pa.bool_())
    if kinds <= {int}:
        return pa.array(values, pa.int64())
    if kinds <= {int, float}:
        return pa.array(values, pa.float64())
    if kinds <= {str}:
        return pa.array(values, pa.string())
    return pa.array([json.dumps(value, default=str) for value in values], pa.string())


def _metadata(name: str) -> dict[str, str] | None:
    unit = unit_of(name)
    return {"unit": unit} if unit else None
