"""Studies of many short runs of the islanding: over random communication graphs, and with other capacitor banks.

The paper prints neither where its capacitors stand nor where its inverters do. Our feeder has 600 kvar in two banks of
300 kvar, at the standard feeder's bus 83 and at bus 151; here they are moved or taken away, and nothing else.
"""

from __future__ import annotations

import math
import random
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

import gridpeers as gp
from gridpeers.measures import Settling, Steady
from gridpeers.output_folders import feeder_folder
from gridpeers.papers.singhal2022.communication_claims import GraphFindings, GraphRun
from gridpeers.papers.singhal2022.islanding_claims import CASES, EVENTS

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

Tell = Callable[[str, float], None]
"""Takes the present run in words, and the share of all runs that is done."""

EventValues = Mapping[tuple[str, str], float]
"""MQSI by case and event."""


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
    progress = _counted(tell, "graphs")
    progress(0, len(drawn))
    rows = gp.sweep(base, {"case.IV.links": links}, cases=["IV"], jobs=jobs, progress=progress)
    for edges, (_, row) in zip(drawn, rows.iterrows(), strict=True):
        if row["status"] != "ran":
            raise RuntimeError(f"topology, a graph with {len(edges)} links: {row['why']}")
    runs = zip(drawn, rows.to_dict("records"), strict=True)
    return GraphFindings(results={}, graphs=tuple(_graph_run(len(names), edges, row) for edges, row in runs))


def _counted(tell: Tell, what: str) -> Callable[[int, int], None]:
    return lambda done, of: tell(f"{done} of {of} {what}", done / of)


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


BANKS: dict[str, dict[str, int]] = {
    "300 kvar at 83, 300 at 151 (ours)": {"83": 100, "151": 100},
    "600 kvar at 83 (as in the standard feeder)": {"83": 200},
    "twice ours: 600 kvar at both": {"83": 200, "151": 200},
    "none of the 600 kvar": {},
}
"""Variants: kvar a phase, by bus."""


def bank_study(base: gp.Scenario, folder: Path, tell: Tell, *, jobs: int | None) -> dict[str, EventValues]:
    """Run all cases of the islanding over all variants, and return their MQSI by variant, case and event.

    The folder takes the variants' feeders; `jobs` as of `gridpeers.sweep`.
    """
    standard = feeder_folder(base.spec.plant.feeder)
    feeders = {
        str(_feeder(standard, folder.absolute() / f"feeder{number}", banks)): variant
        for number, (variant, banks) in enumerate(BANKS.items())
    }
    progress = _counted(tell, "runs")
    progress(0, len(BANKS) * len(CASES))
    varied = {"plant.feeder": list(feeders)}
    rows = gp.sweep(base.replace({"paper": None}), varied, cases=CASES, jobs=jobs, progress=progress)
    found: dict[str, dict[tuple[str, str], float]] = {variant: {} for variant in BANKS}
    for row in rows.fillna(dict.fromkeys((f"{event}.MQSI" for event in EVENTS), 0.0)).to_dict("records"):
        variant = feeders[row["plant.feeder"]]
        if row["status"] != "ran":
            raise RuntimeError(f"capacitor banks, {variant}, case {row['case']}: {row['why']}")
        found[variant] |= {(row["case"], event): row[f"{event}.MQSI"] for event in EVENTS}
    return dict(found)


def _feeder(standard: Path, folder: Path, banks: Mapping[str, int]) -> Path:
    """Return a copy of a feeder's tables in which the banks of buses 83 and 151 are these."""
    shutil.copytree(standard, folder)
    path = folder / "capacitors.csv"
    table = pd.read_csv(path, dtype=str, keep_default_na=False)
    table = table[~table["bus"].isin(["83", "151"])]
    of_bank = table.iloc[0].to_dict() | {"origin": "changed"}
    rows = [of_bank | {"bus": bus} | {f"Q_{phase}_kvar": str(kvar) for phase in "abc"} for bus, kvar in banks.items()]
    pd.concat([table, pd.DataFrame(rows, columns=table.columns)]).to_csv(path, index=False)
    return folder
