"""The columns of a sweep's table, of whatever library the table is made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scenarios.sweep.file import Plan
from scenarios.sweep.sweep_case import SweepRow

FATE = ("status", "why", "trips", "link_warnings", "history_sha256", "links_sha256", "metric_warnings")
"""Columns between parameters and indexes."""


def columns_of(plan: Plan, done: Mapping[int, SweepRow]) -> dict[str, list[Any]]:
    """Return the columns of the table by name, None where there is no value; see `table_of`."""
    numbers = sorted(done)
    rows, ends = [plan.runs[i] for i in numbers], [done[i] for i in numbers]
    columns: dict[str, list[Any]] = {
        "sample": [row.sample for row in rows],
        "case": [row.case for row in rows],
        "seed": [row.scenario.seed for row in rows],
    }
    for name in plan.parameters:
        if name not in columns:
            columns[name] = [row.shown[name] for row in rows]
    columns["status"] = [end.status for end in ends]
    columns["why"] = [end.why or None for end in ends]
    columns["trips"] = [end.trips or None for end in ends]
    columns["link_warnings"] = [end.link_warnings or None for end in ends]
    columns["history_sha256"] = [end.sha256 or None for end in ends]
    columns["links_sha256"] = [end.links_sha256 or None for end in ends]
    if any(run.scenario.metrics for run in rows):
        columns["metric_warnings"] = [end.metric_warnings or None for end in ends]
    for name in dict.fromkeys(name for end in ends for name in end.measures):
        columns[name] = [end.measures.get(name) for end in ends]
    return columns
