"""The table of a sweep, and the units of its columns."""

from __future__ import annotations

import json
import re
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import pandas as pd

from gridpeers.scenarios.results.run_files import write_whole
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.sweep.sweep_case import FATE, SweepRow
from gridpeers.scenarios.sweep.sweep_reading import Plan
from gridpeers.wire.schema.table_schema import INLINE, Field, fields_of

_SUFFIXES = ("s", "Hz", "pu", "W", "var", "V")


def unit_of(name: str) -> str:
    """Return the unit of a column: of a key of the scenario its own, of an index the end of its name."""
    field = _field_at(re.sub(r"^case\.[^.]+\.|\[\d+\]", "", name))
    if field is not None and field.unit:
        return field.unit
    parts = name.split(".")
    if parts[-1] == "V_error" or parts[-2:-1] == ["p"]:
        return "pu"
    suffix = parts[-1].rpartition("_")[2]
    return suffix if suffix in _SUFFIXES and suffix != parts[-1] else ""


def _field_at(key: str) -> Field | None:
    struct: Any = ScenarioModel
    found = None
    for step in key.split("."):
        fields = fields_of(struct) if struct is not None else ()
        inline = (inner for field in fields if INLINE in field.marks for inner in fields_of(field.type))
        found = next((field for field in (*fields, *inline) if step in (field.key, field.name)), None)
        if found is None:
            return None
        struct = _struct_in(found.type)
    return found


def _struct_in(annotation: Any) -> type[msgspec.Struct] | None:
    if isinstance(annotation, type) and issubclass(annotation, msgspec.Struct):
        return annotation
    return next((found for part in typing.get_args(annotation) if (found := _struct_in(part))), None)


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
