"""Axes of a sweep, each a list of settings whose combinations are the samples; among them random graphs."""

from __future__ import annotations

import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations, product
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np

from gridpeers.scenarios.schema.scenario_errors import Problems
from gridpeers.scenarios.sweep.paths import flatten
from gridpeers.wire.schema.table_reading import read_table
from gridpeers.wire.schema.table_schema import Example, Problem, Range, fields_of, problems_of

MOST_POINTS = 1_000_000  # Most values of one range: more are a slip, and would fill the memory before any message


class ValueRange(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A range of values in place of their list."""

    low: float = msgspec.field(name="from")
    """First value."""
    high: float = msgspec.field(name="to")
    """Last value."""
    count: Annotated[int, Range(2, MOST_POINTS)]
    """How many values."""
    spacing: Literal["lin", "log"] = "lin"
    """Whether their differences or their ratios are equal."""

    def relations(self) -> list[Problem]:
        if self.low == self.high:
            return [Problem("", f"a range goes from one number to another, got {self.low:g} twice")]
        if self.spacing == "log" and min(self.low, self.high) <= 0:
            text = f"spacing log needs two numbers above 0, got {self.low:g} and {self.high:g}; or use spacing lin"
            return [Problem("", text)]
        return []

    def listed(self) -> list[float]:
        """Return the values, rounded to 12 digits: 0.1 + 0.2 is meant to be 0.3."""
        log, ratio = self.spacing == "log", self.high / self.low if self.low else 0.0
        fractions = [i / (self.count - 1) for i in range(self.count)]
        raw = [self.low * ratio**x if log else self.low + (self.high - self.low) * x for x in fractions]
        return [float(f"{value:.12g}") for value in raw]


class GraphAxis(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Table `[graph]`: random connected communication graphs of all inverters, for every case of the sweep."""

    links: Annotated[tuple[int, ...], Example("[8, 12, 36]")] = ()
    """Numbers of links, e.g. [8, 12, 36]."""
    per_count: Annotated[int, Range(1, 10_000)] = 10
    """Different graphs for each number of links; fewer where there are no more."""
    seed: int = 1
    """Seed of the graphs. A graph depends on it, its number of links and its own number, and on nothing else here."""


class Sweep(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The keys outside any table come first in the file."""

    name: str = ""
    """Name of the results' folder; without it, that of the file."""
    title: str = ""
    """One line on the study."""
    scenario: str
    """The scenario that is varied: of the catalogue, or the path of a file, seen from this one."""
    cases: Annotated[tuple[str, ...], Example('["IV"]')] = ()
    """Cases that are run for every sample; all when left out."""
    seeds: Annotated[int, Range(1, 10_000)] = 1
    """How many seeds every point is run with: the scenario's, and those that follow it."""
    max_runs: Annotated[int, Range(low=1)] = 20_000
    """A sweep with more runs than this is refused as a slip; raise it when it is meant."""
    set: dict[str, Any] = {}
    """Table `[set]`: keys of the scenario that are other than there, the same in every run."""
    grid: dict[str, Any] = {}
    """Table `[grid]`: every combination of these keys' values: [...] or {from, to, count, spacing = "lin" | "log"}."""
    zip: dict[str, Any] = {}
    """Table `[zip]`: keys that go together, first values with first, so all of one length."""
    graph: GraphAxis = GraphAxis()
    """Table `[graph]`."""


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
    shown: Mapping[str, Any]
    put: Mapping[str, Any]
    """Keys of the scenario, by path."""


class Axis(NamedTuple):
    origin: Mapping[str, str]
    """Key of the sweep file by key of the scenario."""
    settings: Sequence[Setting]
    """Its points, of use only when no problem is noted."""


def samples(settings: Iterable[Sequence[Setting]]) -> Iterator[Setting]:
    for points in product(*settings):
        yield Setting(
            {name: value for point in points for name, value in point.shown.items()},
            {path: value for point in points for path, value in point.put.items()},
        )


def axis_of(values: Mapping[str, Sequence[Any]], origin: Mapping[str, str]) -> Axis:
    rows = [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=False)]
    return Axis(origin, [Setting(row, row) for row in rows])


def own_axes(sweep: Sweep, problems: Problems) -> list[Axis]:
    grid = _values_of(sweep.grid, "grid", problems)
    axes = [axis_of({path: values}, {path: f"grid.{path}"}) for path, values in grid.items()]
    together = _values_of(sweep.zip, "zip", problems)
    counts = {path: len(items) for path, items in together.items()}
    if len(set(counts.values())) > 1 and all(counts.values()):
        listed = ", ".join(f"{path} has {count}" for path, count in counts.items())
        problems.add("zip", f"keys that go together need equally many values, but {listed}; for all combinations: grid")
    return [*axes, axis_of(together, {path: f"zip.{path}" for path in together})] if together else axes


def graph_axes(axis: GraphAxis, inverters: Sequence[str], cases: Sequence[str], problems: Problems) -> list[Axis]:
    n = len(inverters)
    low, high = n - 1, n * (n - 1) // 2
    for links in axis.links:
        if not low <= links <= high:
            why = "fewer cannot join them" if links < low else "there are no more pairs"
            problems.add("graph.links", f"{n} inverters have {low} to {high} links, got {links}: {why}")
    keys = [f"case.{case}.{key}" for case in cases for key in ("graph", "links")]
    points = list[Setting]()
    for links in () if problems.any else axis.links:
        for number, edges in enumerate(connected_graphs(n, links, axis.per_count, axis.seed)):
            pairs = [[inverters[i], inverters[j]] for i, j in edges]
            shown = {
                "graph.links": links,
                "graph.number": number,
                "graph.lambda_2": algebraic_connectivity(n, edges),
                "graph.edges": " ".join("-".join(pair) for pair in pairs),
            }
            put = {f"case.{case}.graph": "links" for case in cases} | {f"case.{case}.links": pairs for case in cases}
            points.append(Setting(shown, put))
    return [Axis(dict.fromkeys(keys, "graph"), points)] if axis.links else []


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
