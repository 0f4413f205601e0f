"""The axes of a sweep: each is a list of settings, and every combination of them is a sample."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations, product
from typing import Any, NamedTuple

import numpy as np

from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.sweep.paths import flatten
from gridpeers.scenarios.sweep.sweep_model import GraphAxis, Sweep, ValueRange
from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.schema.table_schema import fields_of, problems_of

Edges = tuple[tuple[int, int], ...]  # Pairs i < j, sorted

TRIES = 200  # Draws per graph that is asked for, until no more different ones are expected


def connected_graphs(n: int, links: int, count: int, seed: int) -> tuple[Edges, ...]:
    """Return different connected graphs of n nodes, each drawn from its own stream; fewer where no more exist."""
    most = 1 if links == n * (n - 1) // 2 else count
    found: dict[Edges, None] = {}
    for i in range(TRIES * count):
        if len(found) >= most:
            break
        found.setdefault(connected_graph(n, links, random.Random(f"{seed}/{n}/{links}/{i}")))
    return tuple(found)


def connected_graph(n: int, links: int, rng: random.Random) -> Edges:
    """Draw one graph by this distribution; only `rng.random()` is used, the same in every version of Python."""
    assert n - 1 <= links <= n * (n - 1) // 2
    tree = _tree([int(rng.random() * n) for _ in range(n - 2)])
    free = [pair for pair in combinations(range(n), 2) if pair not in tree]
    more = [free.pop(int(rng.random() * len(free))) for _ in range(links - len(tree))]
    return tuple(sorted([*tree, *more]))


def algebraic_connectivity(n: int, edges: Sequence[tuple[int, int]]) -> float:
    r"""Second smallest eigenvalue :math:`\lambda_2` of the Laplacian with weight 1 per link (Fiedler, 1973)."""
    L = np.zeros((n, n))
    for i, j in edges:
        L[[i, j], [i, j]] += 1.0
        L[[i, j], [j, i]] -= 1.0
    return float(f"{np.linalg.eigvalsh(L)[1]:.9g}")  # the last digits are the library's, not the graph's


def _tree(code: Sequence[int]) -> set[tuple[int, int]]:
    """Tree of a Pruefer code: each tree of n labelled nodes has exactly one code of n - 2 numbers below n."""
    n = len(code) + 2
    degree = [1 + code.count(i) for i in range(n)]
    edges = set()
    for node in code:
        leaf = degree.index(1)
        edges.add((min(leaf, node), max(leaf, node)))
        degree[leaf] -= 1
        degree[node] -= 1
    i, j = (node for node in range(n) if degree[node] == 1)
    return edges | {(i, j)}


class Setting(NamedTuple):
    """One point of an axis."""

    shown: Mapping[str, Any]
    put: Mapping[str, Any]
    """Keys of the scenario, by path."""


class Axis(NamedTuple):
    """Keys that vary together; its points are of use only when no problem is noted."""

    origin: Mapping[str, str]
    """Key of the sweep file by key of the scenario."""
    settings: Callable[[], Sequence[Setting]]


def samples(settings: Iterable[Sequence[Setting]]) -> Iterator[Setting]:
    """Return every combination, the last axis fastest."""
    for points in product(*settings):
        yield Setting(
            {name: value for point in points for name, value in point.shown.items()},
            {path: value for point in points for path, value in point.put.items()},
        )


def of_values(values: Mapping[str, Sequence[Any]]) -> Sequence[Setting]:
    """Return the points of keys that go together, first values with first."""
    rows = [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]
    return [Setting(row, row) for row in rows]


def own_axes(sweep: Sweep, problems: Problems) -> list[Axis]:
    """Return the axes of the tables [grid] and [zip]."""
    grid = [
        Axis({path: f"grid.{path}"}, partial(of_values, {path: values}))
        for path, values in _values_of(sweep.grid, "grid", problems).items()
    ]
    return [*grid, *_zip_axes(sweep.zip, problems)]


def _zip_axes(table: Mapping[str, Any], problems: Problems) -> list[Axis]:
    values = _values_of(table, "zip", problems)
    counts = {path: len(items) for path, items in values.items()}
    if len(set(counts.values())) > 1 and all(counts.values()):
        listed = ", ".join(f"{path} has {count}" for path, count in counts.items())
        problems.add("zip", f"keys that go together need equally many values, but {listed}; for all combinations: grid")
    return [Axis({path: f"zip.{path}" for path in values}, partial(of_values, values))] if values else []


def graph_axes(axis: GraphAxis, inverters: Sequence[str], cases: Sequence[str], problems: Problems) -> list[Axis]:
    n = len(inverters)
    low, high = n - 1, n * (n - 1) // 2
    for links in axis.links:
        if not low <= links <= high:
            why = "fewer cannot join them" if links < low else "there are no more pairs"
            problems.add("graph.links", f"{n} inverters have {low} to {high} links, got {links}: {why}")
    keys = [f"case.{case}.{key}" for case in cases for key in ("graph", "links")]
    return [Axis(dict.fromkeys(keys, "graph"), lambda: _graphs(axis, inverters, cases))] if axis.links else []


def _graphs(axis: GraphAxis, inverters: Sequence[str], cases: Sequence[str]) -> Sequence[Setting]:
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
        else:
            found[path] = value
    return found


def _is_range(value: Any) -> bool:
    return isinstance(value, Mapping) and any(key in value for key in _RANGE)
