"""The axes of a sweep: each is a list of settings, and every combination of them is a sample."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Annotated, Any, Literal, TypeGuard

import msgspec

from scenarios.schema.scenario_errors import Problems
from scenarios.sweep.file.graph_axis import algebraic_connectivity, connected_graphs
from scenarios.sweep.file.paths import flatten
from scenarios.sweep.file.sweep_model import GraphAxis
from wire.plausible import Range
from wire.table_reading import read_table
from wire.table_schema import Problem, fields_of, problems_of

MOST_POINTS = 1_000_000
"""Most values of one range: more are a slip, and would fill the memory before anybody could be told."""


class Spread(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
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
        """Return what its values ask of each other."""
        low, high = self.low, self.high
        if low == high:
            return [Problem("", f"a range goes from one number to another, got {low:g} twice")]
        if self.spacing == "log" and min(low, high) <= 0:
            text = f"spacing log needs two numbers above 0, got {low:g} and {high:g}; or use spacing lin"
            return [Problem("", text)]
        return []


_RANGE = tuple(field.key for field in fields_of(Spread))


@dataclass(frozen=True)
class Setting:
    """One point of an axis."""

    shown: Mapping[str, Any]
    """Columns of the table."""
    put: Mapping[str, Any]
    """Keys of the scenario, by path."""


Axis = Sequence[Setting]


def size(axes: Sequence[Axis]) -> int:
    """How many samples there are."""
    return math.prod(len(axis) for axis in axes)


def samples(axes: Sequence[Axis]) -> Iterator[Setting]:
    """Every combination, the last axis fastest."""
    for settings in product(*axes):
        shown: dict[str, Any] = {}
        put: dict[str, Any] = {}
        for setting in settings:
            shown |= setting.shown
            put |= setting.put
        yield Setting(shown, put)


def of_values(values: Mapping[str, Sequence[Any]]) -> Axis:
    """Keys that go together, first values with first.

    Examples
    --------
    >>> [dict(setting.put) for setting in of_values({"gains.k_p": [1, 2], "gains.k_q": [3, 4]})]
    [{'gains.k_p': 1, 'gains.k_q': 3}, {'gains.k_p': 2, 'gains.k_q': 4}]
    """
    rows = [dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True)]
    return [Setting(row, row) for row in rows]


def of_graphs(axis: GraphAxis, inverters: Sequence[str], cases: Sequence[str]) -> Axis:
    """Random connected graphs of the inverters, each put into every case as its listed links."""
    n = len(inverters)
    points = []
    for links in axis.links:
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
    return points


def values_of(table: Mapping[str, Any], where: str, problems: Problems) -> dict[str, list[Any]]:
    """Values of each key of `[grid]` or `[zip]`, problems noted."""
    found = {}
    for path, value in flatten(table, _is_range):
        at = f"{where}.{path}"
        if isinstance(value, Mapping) and _is_range(value):
            values = _spread(value, at, problems)
        elif isinstance(value, list):
            values = value
            if not value:
                problems.add(at, "has no value; list at least one")
            elif where == "grid" and (twice := _twice(value)) is not None:
                problems.add(at, f"lists {twice!r} twice, and nothing is run twice; for more seeds write seeds = n")
        else:
            problems.add(at, f"must be a list of values or {{ from, to, count }}, got {value!r}; write [{value!r}]")
            values = []
        found[path] = values
    return found


def check_zip(values: Mapping[str, Sequence[Any]], problems: Problems) -> None:
    """Keys that go together have equally many values."""
    counts = {path: len(items) for path, items in values.items()}
    if len(set(counts.values())) > 1 and all(counts.values()):
        listed = ", ".join(f"{path} has {count}" for path, count in counts.items())
        problems.add("zip", f"keys that go together need equally many values, but {listed}; for all combinations: grid")
    elif (twice := _twice(list(zip(*values.values(), strict=False)))) is not None:
        problems.add("zip", f"has {twice!r} twice, and nothing is run twice; for more seeds write seeds = n")


def check_graph(axis: GraphAxis, inverters: Sequence[str], problems: Problems) -> None:
    """Each number of links can join the inverters, and is no more than all pairs."""
    n = len(inverters)
    low, high = n - 1, n * (n - 1) // 2
    for i, links in enumerate(axis.links):
        if not low <= links <= high:
            why = "fewer cannot join them" if links < low else "there are no more pairs"
            problems.add("graph.links", f"{n} inverters have {low} to {high} links, got {links}: {why}")
        elif links in axis.links[:i]:
            problems.add("graph.links", f"{links} is listed twice; for more graphs raise per_count")


def _twice(items: Sequence[Any]) -> Any:
    """First item that comes again, or None. They are compared as written: lists and tables are among them."""
    seen = set()
    for item in items:
        if repr(item) in seen:
            return item
        seen.add(repr(item))
    return None


def is_number(value: Any) -> TypeGuard[float]:
    """Whether a value of the file is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_range(value: Any) -> bool:
    return isinstance(value, Mapping) and any(key in value for key in _RANGE)


def _spread(value: Mapping[str, Any], at: str, problems: Problems) -> list[float]:
    """Return the values of a range, rounded to 12 digits: 0.1 + 0.2 is meant to be 0.3."""
    spread, wrong = read_table(Spread, value)
    wrong = wrong or problems_of(spread)
    for path, text in wrong:
        problems.add(f"{at}.{path}" if path else at, text)
    if wrong:
        return []
    low, high = spread.low, spread.high
    fractions = [i / (spread.count - 1) for i in range(spread.count)]
    log = spread.spacing == "log"
    return [float(f"{low * (high / low) ** x if log else low + (high - low) * x:.12g}") for x in fractions]
