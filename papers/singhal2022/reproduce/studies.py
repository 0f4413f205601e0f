"""The study of many short runs of the islanding over random communication graphs."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import gridpeers as gp
from gridpeers.measures import Settling, Steady
from gridpeers.papers.singhal2022.communication_claims import GraphFindings, GraphRun

LINKS, PER_COUNT = (8, 9, 10, 12, 16, 24, 36), 12
"""Links of the connected graphs, most where the paper's curve bends; graphs for each number, but one with 36."""

BELOW, PER_COUNT_BELOW = (4, 5, 6, 7), 2
"""Links of graphs that cannot be connected, which are trees less some links; graphs for each number of links."""

NOT_CONNECTED = 1e-9  # Algebraic connectivity of a graph in parts: 0 but for rounding. That of nine in a path is 0.12.

END_S = 6.0
"""End of the runs (s): after the event at 1 s a path of nine inverters shares within 2 s, the slowest tree in 3 s."""

Tell = Callable[[str, float], None]  # Takes the present run in words, and the share of all runs that is done


def graphs(inverters: int, seed: int) -> Iterator[gp.random_graphs.Edges]:
    """Return all graphs of the study, those that are not connected first."""
    for links in BELOW:
        for number in range(PER_COUNT_BELOW):
            rng = random.Random(f"{seed}/below/{links}/{number}")
            tree = list(gp.random_graphs.connected_graph(inverters, inverters - 1, rng))
            while len(tree) > links:
                tree.pop(int(rng.random() * len(tree)))
            yield tuple(tree)
    for links in LINKS:
        yield from gp.random_graphs.connected_graphs(inverters, links, PER_COUNT, seed)


def topology_study(seed: int, tell: Tell, *, jobs: int | None) -> GraphFindings:
    """Run the islanding of case IV on every graph, in one process each; `jobs` as of `gridpeers.sweep`."""
    scenario = gp.load("islanding")
    names = scenario.inverters
    drawn = list(graphs(len(names), seed))
    links = [[[names[i], names[j]] for i, j in edges] for edges in drawn]
    first = {"case.IV.graph": "links", "case.IV.links": links[0], "time.end_s": END_S, "paper": None}
    base = scenario.replace({**first, "event": scenario.tables["event"][:1]})
    tell("starting", 0.0)
    rows = gp.sweep(
        base, {"case.IV.links": links}, cases=["IV"], jobs=jobs, progress=lambda k, n: tell(f"{k} of {n} graphs", k / n)
    )
    for edges, (_, row) in zip(drawn, rows.iterrows(), strict=True):
        if row["status"] != "ran":
            raise RuntimeError(f"topology, a graph with {len(edges)} links: {row['why']}")
    runs = zip(drawn, rows.to_dict("records"), strict=True)
    return GraphFindings(results={}, graphs=tuple(_graph_run(len(names), edges, row) for edges, row in runs))


def _graph_run(inverters: int, edges: gp.random_graphs.Edges, row: Mapping[str, Any]) -> GraphRun:
    at = {name.removeprefix("event1."): value for name, value in row.items() if name.startswith("event1.")}
    at |= {name: None for name in ("t_f_s", "t_share_s", "t_restore_s") if math.isnan(at[name])}
    return GraphRun(
        links=len(edges),
        connected=gp.random_graphs.algebraic_connectivity(inverters, edges) > NOT_CONNECTED,
        settled=Settling(**{name: at[name] for name in ("t_f_s", "t_share_s", "f_swing_Hz", "V_swing_pu")}),
        steady=Steady(
            **{name: at[name] for name in ("f_error_Hz", "MPSI", "V_error", "MQSI", "t_restore_s")},
            p={name.removeprefix("p."): value for name, value in at.items() if name.startswith("p.")},
        ),
    )
