"""Benchmarks: published experiments that a run is shown beside and judged by; the key `paper` of a scenario names one.

A benchmark is data and pure functions. It is added from outside, by decorator, by entry point (group
"gridpeers.benchmarks") or as `module:Name`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from scenarios.results.published import Published
from wire.anybody import ANYTHING, named
from wire.plugin import plugin_of
from wire.printable import printable
from wire.registry import Registry

if TYPE_CHECKING:
    from scenarios.results.claims.claim import Claim
    from scenarios.results.findings import Findings


def _nothing(found: Findings) -> Sequence[str]:
    return ()


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """What a publication says of one experiment."""

    numbers: tuple[Published, ...] = ()
    """Numbers that it prints; they stand beside ours."""
    claims: tuple[Claim, ...] = ()
    """What it says in words."""
    summary: Callable[[Findings], Sequence[str]] = _nothing
    """How near we come, in a few lines below the claims."""

    def lines(self, found: Findings) -> list[str]:
        """Return the summary of a run; one that raises an exception is a line that says why."""
        try:
            return [printable(str(line), 1000) for line in self.summary(found)]
        except ANYTHING as error:  # a benchmark is anybody's code
            return [f"The benchmark's summary failed: {named(error)}"]

    def number(self, case: str, event: str, quantity: str, island: str = "") -> Published | None:
        """Return the published number at a place of our results, or None where there is none."""
        place = (case, event, quantity, island)
        same = (one for one in self.numbers if (one.case, one.event, one.quantity, one.island) == place)
        return next(same, None)


NO_BENCHMARK = Benchmark()
"""Of a scenario that nobody has published."""


def _objection(it: Any) -> str:
    return "" if isinstance(it, Benchmark) else "it is no gridpeers.benchmarks.Benchmark"


BENCHMARKS: Registry[Benchmark] = Registry(
    "benchmark",
    "benchmarks",
    _objection,
    own={
        name: f"papers.singhal2022.paper_benchmarks:{name.replace('-', '_').upper()}"
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
