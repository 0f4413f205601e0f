"""Benchmarks: published experiments that a run is shown beside and judged by; the key `paper` of a scenario names one.

A benchmark is data and pure functions. It is added from outside, by decorator, by entry point (group
"gridpeers.benchmarks") or as `module:Name`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from gridpeers.scenarios.results.evaluation.quantities import Quantity
from gridpeers.wire.plugins.anybody import ANYTHING, named
from gridpeers.wire.plugins.foreign_code import foreign_code
from gridpeers.wire.plugins.plugin import callable_objection, plugin_of
from gridpeers.wire.plugins.registry import Registry
from gridpeers.wire.printable import printable

if TYPE_CHECKING:
    from gridpeers.scenarios.results.evaluation.claims import Claim
    from gridpeers.scenarios.results.findings import Findings


@dataclass(frozen=True, kw_only=True)
class Published:
    """One published number.

    Examples
    --------
    >>> place = {"case": "IV", "event": "event1", "quantity": "MPSI"}
    >>> number = Published(source="Table 1", **place, paper=0.12, digits=2, limit=0.02)
    >>> number.where, number.within(0.13), number.within(0.15)
    ('case IV, event1', True, False)
    """

    source: str
    """Place in the publication, e.g. "Table I"."""
    case: str
    """Case of our scenario."""
    event: str
    """Event of our scenario after which it is measured."""
    island: str = ""
    """First inverter of the island that it is about; "" for the whole microgrid."""
    quantity: Quantity
    paper: float
    """The number that the publication prints."""
    digits: int
    """Decimals that it prints."""
    limit: float | None = None
    """Largest difference that passes, in its unit; None where nothing is judged by it."""

    @property
    def where(self) -> str:
        """Place for people, e.g. "case II, event2"."""
        return f"case {self.case}, {self.event}" + (f", island of {self.island}" if self.island else "")

    def within(self, ours: float) -> bool | None:
        """Return whether our number is near enough; None where the number is not judged.

        Both count at the precision of the computation: a printed 0.14 stands for exactly 0.14.
        """
        return None if self.limit is None else abs(ours - self.paper) <= self.limit


def _claim_objection(it: Any) -> str:
    from gridpeers.scenarios.results.evaluation.claims import Claim  # numpy, which a scenario is read without

    return "" if isinstance(it, Claim) else callable_objection(it, "findings")


CLAIMS: Registry[Any] = Registry("claim", "claims", _claim_objection)
"""Claims by name. Those of a publication come with its `Benchmark`."""


def _nothing(findings: Findings) -> Sequence[str]:
    return ()


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """A publication's numbers and claims on one experiment."""

    numbers: tuple[Published, ...] = ()
    """Numbers that it prints; they stand beside ours."""
    claims: tuple[Claim, ...] = ()
    """Its sentences."""
    summary: Callable[[Findings], Sequence[str]] = _nothing
    """Return our distance from it, in a few lines below the claims."""

    def lines(self, findings: Findings) -> list[str]:
        """Return the summary of a run; one that raises an exception is a line that says why."""
        try:
            with foreign_code():
                return [printable(str(line), 1000) for line in self.summary(findings)]
        except ANYTHING as error:  # a benchmark is a user's code
            return [f"The benchmark's summary failed: {named(error)}"]

    def number(self, case: str, event: str, quantity: str, island: str = "") -> Published | None:
        """Return the published number at a place of our results, or None where there is none."""
        place = (case, event, quantity, island)
        same = (one for one in self.numbers if (one.case, one.event, one.quantity, one.island) == place)
        return next(same, None)


NO_BENCHMARK = Benchmark()
"""The benchmark of a scenario that nobody has published."""


def _benchmark_objection(it: Any) -> str:
    return "" if isinstance(it, Benchmark) else "it is no gridpeers.benchmarks.Benchmark"


BENCHMARKS: Registry[Benchmark] = Registry(
    "benchmark",
    "benchmarks",
    _benchmark_objection,
    own={
        name: f"gridpeers.papers.singhal2022.paper_benchmarks:{name.replace('-', '_').upper()}"
        for name in ("islanding", "intermittency", "communication", "switching", "plug-n-play", "wind-up")
    },
)
"""Benchmarks by name; those that come with gridpeers are references, which are imported when a run is judged."""


def benchmark_of(key: str | Mapping[str, Any]) -> Benchmark:
    """Return the benchmark that a scenario names in its key `paper`; an empty one for "".

    Raises
    ------
    PluginError
        If there is none of this name.
    """
    plugin = plugin_of(key)
    return BENCHMARKS.resolve(plugin.use, plugin.folder) if plugin.use else NO_BENCHMARK
