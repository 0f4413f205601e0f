"""The axes of a sweep: each is a list of settings, and every combination of them is a sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.sweep.file.graph_axis import algebraic_connectivity, connected_graphs
from gridpeers.scenarios.sweep.file.paths import flatten
from gridpeers.scenarios.sweep.file.sweep_model import GraphAxis, ValueRange
from gridpeers.wire.schema.relations import problems_of
from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.schema.table_schema import fields_of


class Setting(NamedTuple):
    """One point of an axis."""

    shown: Mapping[str, Any]
    """Columns of the table."""
    put: Mapping[str, Any]
    """Keys of the scenario, by path."""


@dataclass(frozen=True)
class Axis:
    """Keys that vary together."""

    origin: Mapping[str, str]
    """Key of the sweep file by key of the scenario."""
    settings: Callable[[], Sequence[Setting]]
    """Makes the points; of use only when no problem is noted."""


def samples(settings: Iterable[Sequence[Setting]]) -> Iterator[Setting]:
    """Return every combination, the last axis fastest."""
    for points in product(*settings):
        yield Setting(
            {name: value for point in points for name, value in point.shown.items()},
            {path: value for point in points for path, value in point.put.items()},
        )


def of_values(values: Mapping[str, Sequence[Any]]) -> Sequence[Setting]:
    """Return the points of keys that go together, first values with first.

    Examples
    --------
    >>> [dict(setting.put) for setting in of_values({"gains.k_p": [1, 2], "gains.k_q": [3, 4]})]
    [{'gains.k_p': 1, 'gains.k_q': 3}, {'gains.k_p': 2, 'gains.k_q': 4}]
    """
    rows = [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]
    return [Setting(row, row) for row in rows]


def value_axis(values: Mapping[str, Sequence[Any]], table: str) -> Axis:
    """Return the axis of keys of one table that go together."""
    return Axis({path: f"{table}.{path}" for path in values}, lambda: of_values(values))


def grid_axes(table: Mapping[str, Any], problems: Problems) -> list[Axis]:
    """Return an axis for each key of `[grid]`."""
    return [value_axis({path: values}, "grid") for path, values in _values_of(table, "grid", problems).items()]


def zip_axes(table: Mapping[str, Any], problems: Problems) -> list[Axis]:
    """Return the one axis of the keys of `[zip]`, or none; they have equally many values."""
    values = _values_of(table, "zip", problems)
    counts = {path: len(items) for path, items in values.items()}
    if len(set(counts.values())) > 1 and all(counts.values()):
        listed = ", ".join(f"{path} has {count}" for path, count in counts.items())
        problems.add("zip", f"keys that go together need equally many values, but {listed}; for all combinations: grid")
    elif (twice := _twice(list(zip(*values.values(), strict=False)))) is not None:
        problems.add("zip", f"has {twice!r} twice, and nothing is run twice; for more seeds write seeds = n")
    return [value_axis(values, "zip")] if values else []


def graph_axes(axis: GraphAxis, inverters: Sequence[str], cases: Sequence[str], problems: Problems) -> list[Axis]:
    """Return the one axis of random graphs, or none; each number of links can join the inverters."""
    n = len(inverters)
    low, high = n - 1, n * (n - 1) // 2
    for i, links in enumerate(axis.links):
        if not low <= links <= high:
            why = "fewer cannot join them" if links < low else "there are no more pairs"
            problems.add("graph.links", f"{n} inverters have {low} to {high} links, got {links}: {why}")
        elif links in axis.links[:i]:
            problems.add("graph.links", f"{links} is listed twice; for more graphs raise per_count")
    keys = [f"case.{case}.{key}" for case in cases for key in ("graph", "links")]
    return [Axis(dict.fromkeys(keys, "graph"), lambda: _graphs(axis, inverters, cases))] if axis.links else []


def _graphs(axis: GraphAxis, inverters: Sequence[str], cases: Sequence[str]) -> Sequence[Setting]:
    """Draw the graphs; each is put into every case as its listed links."""
    points = []
    for links in axis.links:
        for number, edges in enumerate(connected_graphs(len(inverters), links, axis.per_count, axis.seed)):
            pairs = [[inverters[i], inverters[j]] for i, j in edges]
            shown = {
                "graph.links": links,
                "graph.number": number,
                "graph.lambda_2": algebraic_connectivity(len(inverters), edges),
                "graph.edges": " ".join("-".join(pair) for pair in pairs),
            }
            put = {f"case.{case}.graph": "links" for case in cases} | {f"case.{case}.links": pairs for case in cases}
            points.append(Setting(shown, put))
    return points


_RANGE = tuple(field.key for field in fields_of(ValueRange))


def _values_of(table: Mapping[str, Any], where: str, problems: Problems) -> dict[str, list[Any]]:
    """Return the values of each key of `[grid]` or `[zip]`; a key with a problem has none."""
    found: dict[str, list[Any]] = {}
    for path, value in flatten(table, _is_range):
        at, found[path] = f"{where}.{path}", []
        if _is_range(value):
            values, wrong = read_table(ValueRange, value)
            wrong = wrong or problems_of(values)
            for key, text in wrong:
                problems.add(f"{at}.{key}" if key else at, text)
            found[path] = [] if wrong else values.listed()
        elif not isinstance(value, list):
            problems.add(at, f"must be a list of values or {{ from, to, count }}, got {value!r}; write [{value!r}]")
        elif not value:
            problems.add(at, "has no value; list at least one")
        elif where == "grid" and (twice := _twice(value)) is not None:
            problems.add(at, f"lists {twice!r} twice, and nothing is run twice; for more seeds write seeds = n")
        else:
            found[path] = value
    return found


def _twice(items: Sequence[Any]) -> Any:
    """Return the first item that comes again, or None; items are compared as written, as lists are among them."""
    seen: set[str] = set()
    for item in items:
        if repr(item) in seen:
            return item
        seen.add(repr(item))
    return None


def is_number(value: Any) -> bool:
    """Return whether a value of the file is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_range(value: Any) -> bool:
    return isinstance(value, Mapping) and any(key in value for key in _RANGE)
