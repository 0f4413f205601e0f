"""The paper's claims on the communication topology: random connected graphs of 8 to 36 links (section 4, figure)."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

from gridpeers.benchmarks import MPSI_BAND, Findings, Settling, Steady
from gridpeers.papers.singhal2022.experiment_claims import ExperimentClaims
from gridpeers.papers.singhal2022.tables import FEW_LINKS, SAME_END, STEEPER


@dataclass(frozen=True, kw_only=True)
class GraphRun:
    """A run on one random graph: settling after the event, and steady values."""

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


TREE, BEND = 8, int(FEW_LINKS.value)
"""Links of a tree of nine inverters, with fewer of which no graph is connected; and where the paper's curve bends."""

claims = ExperimentClaims("topology", source="section 4, figure of topologies", figure="topology")


def medians(runs: tuple[GraphRun, ...]) -> dict[int, float]:
    """Return the median time (s) to MPSI < 0.01 by number of links; infinite where most never share."""
    by_links: dict[int, list[float]] = {}
    for run in runs:
        t = run.settled.t_share_s
        by_links.setdefault(run.links, []).append(float("inf") if t is None else t)
    return {links: median(by_links[links]) for links in sorted(by_links)}


def connected(found: Findings) -> tuple[GraphRun, ...]:
    """Return the runs on connected graphs."""
    return tuple(run for run in graph_runs(found) if run.connected)


@claims.add("time to MPSI < 0.01 falls with the number of links")
def more_links_are_faster(found: Findings) -> tuple[bool, str]:
    times = medians(connected(found))
    first, last = min(times), max(times)
    shown = ", ".join(f"{links} links {times[links]:.2f} s" for links in (first, BEND, last))
    return times[last] < times[BEND] < times[first], shown


@claims.add("it rises slowly from 36 down to about 12 links, and sharply toward 8")
def steepest_at_few_links(found: Findings) -> tuple[bool, str]:
    times = medians(connected(found))
    last = max(times)
    few = (times[TREE] - times[BEND]) / (BEND - TREE)
    many = (times[BEND] - times[last]) / (last - BEND)
    shown = f"{1e3 * few:.0f} ms a link from {TREE} to {BEND}, {1e3 * many:.1f} ms from there to {last}"
    return few > STEEPER.value * many, shown


@claims.add("all connected graphs reach the same steady state")
def same_steady_state(found: Findings) -> tuple[bool, str]:
    runs = connected(found)
    f_error, MPSI = max(run.steady.f_error_Hz for run in runs), max(run.steady.MPSI for run in runs)
    shown = f"{len(runs)} graphs: abs(f-60) at most {f_error:.4f} Hz, MPSI at most {MPSI:.4f}"
    return max(f_error, MPSI) < SAME_END.value, shown


@claims.add("below 8 links there is no consensus")
def none_below_8(found: Findings) -> tuple[bool, str]:
    runs = [run for run in graph_runs(found) if run.links < TREE]
    least = min((run.steady.MPSI for run in runs), default=0.0)
    return bool(runs) and least >= MPSI_BAND, f"{len(runs)} graphs: MPSI at least {least:.3f}"
