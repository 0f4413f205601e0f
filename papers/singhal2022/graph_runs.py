"""What the runs over random communication graphs came to: the paper's figure of topologies is made from them."""

from __future__ import annotations

from dataclasses import dataclass

from gridpeers.benchmarks import Findings, Settling, Steady


@dataclass(frozen=True, kw_only=True)
class GraphRun:
    """A run on one random graph: how the event settled, and what it left."""

    links: int
    """Links of the graph."""
    connected: bool
    """Whether there is a way between any two inverters; a graph with links enough may still lack one."""
    settled: Settling
    steady: Steady


@dataclass(frozen=True, kw_only=True)
class GraphFindings(Findings):
    """Findings of an experiment that is one event over many graphs."""

    graphs: tuple[GraphRun, ...] = ()


def graph_runs(found: Findings) -> tuple[GraphRun, ...]:
    """Return the runs over graphs; none of an experiment that has other findings."""
    return found.graphs if isinstance(found, GraphFindings) else ()
