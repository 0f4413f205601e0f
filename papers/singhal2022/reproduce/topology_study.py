"""The paper's topology figure: islanding over random communication graphs, connected ones and ones that are not."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import gridpeers as gp
from gridpeers.benchmarks import Settling, Steady
from gridpeers.papers.singhal2022.claims.topology_claims import GraphFindings, GraphRun
from gridpeers.random_graphs import Edges, algebraic_connectivity, connected_graph, connected_graphs

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

TellProgress = Callable[[int, int], None]
"""Is called with the number of runs that are done, and of all runs."""


def graphs(inverters: int, seed: int) -> Iterator[Edges]:
    """Return all graphs of the study, those that are not connected first.

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


def study(seed: int, tell: TellProgress, *, jobs: int | None, dask: str = "") -> GraphFindings:
    """Run the islanding of case IV on every graph, always in one process each.

    Parameters
    ----------
    seed : int
        Of the graphs.
    tell : TellProgress
        Is called with the progress.
    jobs : int or None
        How many runs at a time; None is one per core, or one where joblib is not installed.
    dask : str, optional
        Address of a Dask scheduler to use instead.
    """
    scenario = gp.load("islanding")
    names = scenario.inverters
    drawn = list(graphs(len(names), seed))
    links = [[[names[i], names[j]] for i, j in edges] for edges in drawn]
    first = {"case.IV.graph": "links", "case.IV.links": links[0], "time.end_s": END_S, "paper": None}
    base = scenario.replace({**first, "event": scenario.tables["event"][:1]})
    tell(0, len(drawn))
    rows = gp.sweep(base, {"case.IV.links": links}, cases=["IV"], jobs=jobs, dask=dask, progress=tell)
    for edges, (_, row) in zip(drawn, rows.iterrows(), strict=True):
        if row["status"] != "ran":
            raise RuntimeError(f"topology, a graph with {len(edges)} links: {row['why']}")
    runs = zip(drawn, rows.to_dict("records"), strict=True)
    return GraphFindings(results={}, graphs=tuple(_graph_run(len(names), edges, row) for edges, row in runs))


def _graph_run(inverters: int, edges: Edges, row: Mapping[str, Any]) -> GraphRun:
    at = {name.removeprefix("event1."): value for name, value in row.items() if name.startswith("event1.")}

    def time(name: str) -> float | None:
        return None if math.isnan(at[name]) else float(at[name])

    return GraphRun(
        links=len(edges),
        connected=algebraic_connectivity(inverters, edges) > NOT_CONNECTED,
        settled=Settling(
            t_f_s=time("t_f_s"),
            t_share_s=time("t_share_s"),
            f_swing_Hz=at["f_swing_Hz"],
            V_swing_pu=at["V_swing_pu"],
        ),
        steady=Steady(
            f_error_Hz=at["f_error_Hz"],
            MPSI=at["MPSI"],
            V_error=at["V_error"],
            MQSI=at["MQSI"],
            t_restore_s=time("t_restore_s"),
            p={name.removeprefix("p."): value for name, value in at.items() if name.startswith("p.")},
        ),
    )
