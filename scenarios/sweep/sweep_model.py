"""A sweep file as types: its keys, their ranges and their defaults."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

from gridpeers.wire.schema.table_schema import Example, Problem, Range

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
