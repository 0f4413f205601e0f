"""What the paper claims of the communication topology: random connected graphs of 8 to 36 links (section 4, figure)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from statistics import median

from gridpeers.benchmarks import MPSI_BAND, Claim, Findings, Settling, Steady
from papers.singhal2022.tolerances import FEW_LINKS, SAME_END, STEEPER


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


TREE = 8
"""Links of a tree of nine inverters: with fewer, no graph is connected."""

SOURCE = "section 4, figure of topologies"


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


def _falls(found: Findings) -> tuple[bool, str]:
    times = medians(connected(found))
    first, last = min(times), max(times)
    holds = times[last] < times[int(FEW_LINKS.value)] < times[first]
    shown = (first, int(FEW_LINKS.value), last)
    return holds, ", ".join(f"{links} links {times[links]:.2f} s" for links in shown)


def _steepest_at_few(found: Findings) -> tuple[bool, str]:
    times = medians(connected(found))
    bend, last = int(FEW_LINKS.value), max(times)
    few = (times[TREE] - times[bend]) / (bend - TREE)
    many = (times[bend] - times[last]) / (last - bend)
    return (
        few > STEEPER.value * many,
        f"{1e3 * few:.0f} ms a link from {TREE} to {bend}, {1e3 * many:.1f} ms from there to {last}",
    )


def _same_end(found: Findings) -> tuple[bool, str]:
    runs = connected(found)
    f_error, MPSI = max(run.steady.f_error_Hz for run in runs), max(run.steady.MPSI for run in runs)
    text = f"{len(runs)} graphs: abs(f-60) at most {f_error:.4f} Hz, MPSI at most {MPSI:.4f}"
    return max(f_error, MPSI) < SAME_END.value, text


def _none_below(found: Findings) -> tuple[bool, str]:
    runs = [run for run in graph_runs(found) if run.links < TREE]
    least = min((run.steady.MPSI for run in runs), default=0.0)
    return bool(runs) and least >= MPSI_BAND, f"{len(runs)} graphs: MPSI at least {least:.3f}"


_claim = partial(Claim, source=SOURCE, figure="topology", measures=())
"""What all claims of this experiment have in common."""

TOPOLOGY: tuple[Claim, ...] = (
    _claim(
        name="more_links_are_faster",
        text="time to MPSI < 0.01 falls with the number of links",
        judge=_falls,
    ),
    _claim(
        name="steepest_at_few_links",
        text="it rises slowly from 36 down to about 12 links, and sharply toward 8",
        judge=_steepest_at_few,
    ),
    _claim(
        name="same_steady_state",
        text="all connected graphs reach the same steady state",
        judge=_same_end,
    ),
    _claim(
        name="none_below_8",
        text="below 8 links there is no consensus",
        judge=_none_below,
    ),
)
"""Claims of the topologies."""
