"""Random connected graphs of 8 to 36 links, with links at once and late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES, SweepData, times_of
from gridpeers.papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Page,
    TableCell,
    time_panels,
)
from gridpeers.random_graphs import Control, adjacency
from gridpeers.theory import InverterGroup, predicted_times

DELAY, LINKS = "link[0].delay", "graph.links"
PREDICTED = ("predicted f", "predicted sharing")
"""Columns of the predicted times (s)."""


def topology(sweep: SweepData) -> ExperimentResult:
    """Return the times against the number of links, with and without delay, measured and predicted."""
    theory = [
        times_of(predicted_times(on_graph(sweep, edges), link_delay_s=d, load=sweep.load))
        for edges, d in zip(sweep.rows["graph.edges"], sweep.rows[DELAY], strict=True)
    ]
    runs = sweep.rows.assign(**dict(zip(PREDICTED, np.array(theory).T, strict=True)))
    delays = sweep.values(DELAY)

    def curves(number: int, index: str) -> list[Curve]:
        found = []
        for style, d in enumerate(delays):
            x, y = sweep.curve(LINKS, index, {DELAY: d})
            low, high = (sweep.curve(LINKS, index, {DELAY: d}, over)[1] for over in (np.min, np.max))
            rows = runs[runs[DELAY] == d]
            at = (rows[LINKS] + 0.25 * (-1.0) ** rows["graph.number"]).to_numpy(float)
            medians = rows.groupby(LINKS)[PREDICTED[number]].median().to_numpy()
            found += [
                Curve(x, y, style, low=low, high=np.minimum(high, 1e3)),
                Curve(at, sweep.measured(index, rows), style, "points"),
                Curve(x, medians, style, "predicted"),
            ]
        return found

    page = Page(
        title="Random connected graphs",
        panels=time_panels(
            curves,
            x_label="links of the communication graph",
            log="y",
            x_ticks=[8, 12, 16, 20, 24, 28, 32, 36],
            y_range=(0.3, 15.0),
        ),
        columns=2,
        names={style: f"links late by {d:g} s" if d else "links at once" for style, d in enumerate(delays)},
        looks={"measured": "median and range", "points": "a graph", "predicted": "predicted, median"},
        share_y=True,
    )
    table: list[list[TableCell]] = []
    for (d, links), rows in runs.groupby([DELAY, LINKS]):
        row: list[TableCell] = [d, links, len(rows)]
        for number, (index, _) in enumerate(INDEXES):
            times = sweep.measured(index, rows)
            predicted = rows[PREDICTED[number]].median()
            row += [float(x) for x in (predicted, np.median(times), times.min(), times.max())]
        table.append(row)
    columns = ["delay (s)", "links", "graphs"]
    columns += [f"{w}, {h} (s)" for w in ("f", "sharing") for h in ("predicted", "median", "lowest", "highest")]
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=table))


def on_graph(sweep: SweepData, edges: str) -> InverterGroup:
    """Return the inverters on a graph of the sweep, written "inv1-inv2 inv2-inv5 ..."."""
    first, rest = zip(*(edge.split("-") for edge in edges.split()), strict=True)
    control = Control(secondary="all", graph="links", links=tuple(zip(first, rest, strict=True)))
    rows = {inverter.name: inverter for inverter in sweep.feeder.inverters}
    return replace(next(iter(sweep.inverters.values())), A=np.array(adjacency(control, rows)))
