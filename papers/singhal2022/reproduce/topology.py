"""The paper's topology figure: islanding over random communication graphs, connected ones and ones that are not."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec

from msgspec.structs import replace

from gridpeers.benchmarks import Findings, GraphRun, Steady
from gridpeers.graphs import Edges, algebraic_connectivity, connected_graph, connected_graphs
from gridpeers.measures import Settling
from scenarios.spec import Case, Scenario, load_scenario
from scenarios.sweep.one import Done, run_one

LINKS = (8, 9, 10, 12, 16, 24, 36)
"""Links of the connected graphs; most where the paper's curve bends."""

PER_COUNT = 12
"""Connected graphs for each number of links; with 36 there is but one."""

BELOW = (4, 5, 6, 7)
"""Links of graphs that cannot be connected, which are trees less some links."""

PER_COUNT_BELOW = 2
"""Graphs for each of these."""

NOT_CONNECTED = 1e-9
"""Algebraic connectivity of a graph in parts: 0 but for rounding. That of nine in a path is 0.12."""

END_S = 6.0
"""End of the runs (s): after the event at 1 s a path of nine inverters shares within 2 s, the slowest tree in 3 s."""

Told = Callable[[int, int], None]
"""Told how many runs are done, and of how many."""


def graphs(inverters: int, seed: int) -> Iterator[Edges]:
    """All graphs of the study, those that are not connected first.

    Examples
    --------
    >>> drawn = list(graphs(9, seed=1))
    >>> len(drawn), sorted({len(edges) for edges in drawn})
    (81, [4, 5, 6, 7, 8, 9, 10, 12, 16, 24, 36])
    """
    for links in BELOW:
        for number in range(PER_COUNT_BELOW):
            rng = random.Random(f"{seed}/below/{links}/{number}")
            tree = list(connected_graph(inverters, inverters - 1, rng))
            while len(tree) > links:
                tree.pop(int(rng.random() * len(tree)))
            yield tuple(tree)
    for links in LINKS:
        yield from connected_graphs(inverters, links, PER_COUNT, seed)


def study(seed: int, tell: Told, *, jobs: int) -> Findings:
    """Run the islanding of case IV on every graph, always in one process each.

    Parameters
    ----------
    seed : int
        Of the graphs.
    tell : Told
        Told of progress.
    jobs : int
        How many runs at a time; with joblib not installed, one.
    """
    scenario, feeder = load_scenario("islanding")
    names = tuple(row.name for row in feeder.inverters)
    drawn = list(graphs(len(names), seed))
    done = dict.fromkeys(range(len(drawn)), Done(number=0, status="broke"))
    tell(0, len(drawn))
    for count, end in enumerate(run_all([(_on(scenario, names, edges), "IV") for edges in drawn], jobs), start=1):
        if end.status == "broke":
            raise RuntimeError(f"topology, graph {end.number} with {len(drawn[end.number])} links: {end.why}")
        done[end.number] = end
        tell(count, len(drawn))
    return Findings(results={}, graphs=tuple(_graph_run(len(names), edges, done[i]) for i, edges in enumerate(drawn)))


def _on(scenario: Scenario, names: tuple[str, ...], edges: Edges) -> Scenario:
    """The islanding alone, on one graph."""
    links = tuple((names[i], names[j]) for i, j in edges)
    case: Case = replace(scenario.cases["IV"], graph="links", links=links)
    time = replace(scenario.time, end_s=END_S)
    return replace(scenario, time=time, events=scenario.events[:1], cases={"IV": case}, paper="")


def run_all(runs: Sequence[tuple[Scenario, str]], jobs: int) -> Iterator[Done]:
    """Run cases without their folders, several at a time where joblib is there; each comes back when it is done.

    Parameters
    ----------
    runs : Sequence[tuple[Scenario, str]]
        Scenarios, and the case of each.
    jobs : int
        How many at a time.
    """
    if jobs == 1 or find_spec("joblib") is None:
        for number, (scenario, case) in enumerate(runs):
            yield run_one(number, scenario, case)
        return
    from scenarios.sweep.file import Run
    from scenarios.sweep.workers import on_this_machine

    numbered = [(i, Run(sample=i, case=case, scenario=scenario, shown={})) for i, (scenario, case) in enumerate(runs)]
    yield from on_this_machine(numbered, jobs)


def _graph_run(inverters: int, edges: Edges, done: Done) -> GraphRun:
    at = {name.removeprefix("event1."): value for name, value in done.measures.items()}

    def number(name: str) -> float:
        value = at[name]
        return float("nan") if value is None else value

    return GraphRun(
        links=len(edges),
        connected=algebraic_connectivity(inverters, edges) > NOT_CONNECTED,
        settled=Settling(
            t_f_s=at["t_f_s"],
            t_share_s=at["t_share_s"],
            f_swing_Hz=number("f_swing_Hz"),
            V_swing_pu=number("V_swing_pu"),
        ),
        steady=Steady(
            f_error_Hz=number("f_error_Hz"),
            MPSI=number("MPSI"),
            V_error=number("V_error"),
            MQSI=number("MQSI"),
            t_restore_s=at["t_restore_s"],
            p={name.removeprefix("p."): number(name) for name in at if name.startswith("p.")},
        ),
    )
