"""The table of a sweep, and units and words for its columns."""

from __future__ import annotations

import json
import re
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pandas as pd

from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.sweep.sweep_case import FATE, SweepRow
from gridpeers.scenarios.sweep.sweep_reading import Plan
from gridpeers.scenarios.versions import versions
from gridpeers.wire.schema.table_schema import INLINE, Field, Label, fields_of

_SUFFIXES = ("s", "Hz", "pu", "W", "var", "V")


class IndexAxis(NamedTuple):
    label: str
    least: float
    """Least length, in the index's unit: smaller differences are rounding, or too small to see."""


INDEXES = {
    "f_error_Hz": IndexAxis("settled abs(f - f_nom) (Hz)", 0.01),
    "MPSI": IndexAxis("settled power sharing index, MPSI", 0.01),
    "V_error": IndexAxis("settled mean abs(V - 1) (pu)", 0.001),
    "MQSI": IndexAxis("settled var sharing index, MQSI", 0.01),
    "t_restore_s": IndexAxis("time to restore f and sharing (s)", 0.02),
    "t_load_s": IndexAxis("time to take over the load (s)", 0.02),
    "t_f_s": IndexAxis("time to restore f (s)", 0.02),
    "t_share_s": IndexAxis("time to share power (s)", 0.02),
    "f_swing_Hz": IndexAxis("swing of f at the end (Hz)", 0.001),
    "V_swing_pu": IndexAxis("swing of V at the end (pu)", 0.0001),
    "f_off_Hz": IndexAxis("largest abs(f - f_nom) at the end (Hz)", 0.01),
    "S_max_pu": IndexAxis("largest apparent power at the end (pu)", 0.01),
    "V_min_pu": IndexAxis("least voltage at the end (pu)", 0.001),
    "V_max_pu": IndexAxis("largest voltage at the end (pu)", 0.001),
    "steady": IndexAxis("steady at the end (1: yes, 0: no)", 1.0),
}

GRAPH_WORDS = {"graph.links": "links of the graph", "graph.lambda_2": "algebraic connectivity, lambda_2"}


def unit_of(name: str) -> str:
    """Return the unit of a column: of a key of the scenario its own, of an index the end of its name."""
    field = _field_at(_apart(name)[0])
    if field is not None and field.unit:
        return field.unit
    parts = name.split(".")
    if parts[-1] == "V_error" or parts[-2:-1] == ["p"]:
        return "pu"
    suffix = parts[-1].rpartition("_")[2]
    return suffix if suffix in _SUFFIXES and suffix != parts[-1] else ""


def label_of(name: str) -> str:
    """Return words for an axis, with the unit: those of the field's `Label`, or the key's last part and its table."""
    if (index := name.rpartition(".")[2]) in INDEXES:
        return INDEXES[index].label
    key, case = _apart(name)
    field, unit = _field_at(key), unit_of(key)
    label = field.mark(Label) if field else None
    table, _, last = key.rpartition(".")
    words = last.removesuffix("_" + unit) + (f" of [{table}]" if table else "")
    words = label.text if label else GRAPH_WORDS.get(key, words)
    return words + (f" ({unit})" if unit else "") + (f", case {case}" if case else "")


def _apart(name: str) -> tuple[str, str]:
    case = re.match(r"case\.([^.]+)\.", name)
    return re.sub(r"\[\d+\]", "", name[case.end() :] if case else name), case[1] if case else ""


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
    mixed = [name for name in plan.parameters if frame[name].dtype == object]
    return frame.assign(**{name: [json.dumps(value, default=str) for value in frame[name]] for name in mixed})


def write_table(frame: pd.DataFrame, plan: Plan, folder: Path) -> Path:
    """Write a table at once or not at all; its metadata has units, sweep file, base scenario and versions."""
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
