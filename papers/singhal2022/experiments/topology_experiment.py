"""Random connected graphs of 8 to 36 links, with links at once and late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from gridpeers.measures import Floats
from gridpeers.random_graphs import Control, adjacency
from gridpeers.theory import InverterGroup, predicted_times
from papers.singhal2022.experiments.delay_experiment import INDEXES, of_times
from papers.singhal2022.experiments.experiment_data import RunColumns, SweepData
from papers.singhal2022.experiments.experiment_output import Curve, ExperimentResult, ExperimentTable, Look, Page, Panel

DELAY, LINKS = "link[0].delay", "graph.links"


def topology(swept: SweepData) -> ExperimentResult:
    """Return the times against the number of links, with and without delay, measured and predicted."""
    said = {(row["sample"]): _said(swept, row) for row in swept.rows}
    delays = swept.values(DELAY)
    panels = []
    for number, (index, title) in enumerate(INDEXES):
        curves = []
        for style, d in enumerate(delays):
            x, y = swept.curve(LINKS, index, {DELAY: d})
            low, high = (swept.curve(LINKS, index, {DELAY: d}, over)[1] for over in (np.min, np.max))
            curves.append(Curve(x=x, y=y, style=style, low=low, high=np.minimum(high, 1e3)))
            rows = list(swept.where({DELAY: d}))
            at = np.array([row[LINKS] + 0.25 * (-1) ** row["graph.number"] for row in rows])
            curves.append(Curve(x=at, y=_of(swept, rows, index), style=style, look="points"))
            curves.append(Curve(x=x, y=_medians(said, rows, x, number), style=style, look="predicted"))
        panels.append(
            Panel(
                title=title,
                x_label="links of the communication graph",
                y_label="time after islanding (s)",
                curves=curves,
                log="y",
                x_ticks=[8, 12, 16, 20, 24, 28, 32, 36],
                y_range=(0.3, 15.0),
            )
        )
    looks: Mapping[Look, str] = {"measured": "median and range", "points": "a graph", "predicted": "predicted, median"}
    page = Page(
        title="Random connected graphs",
        panels=panels,
        columns=2,
        names={style: f"links late by {d:g} s" if d else "links at once" for style, d in enumerate(delays)},
        looks=looks,
        share_y=True,
    )
    return ExperimentResult(page=page, table=_table(swept, said))


def _table(swept: SweepData, said: Mapping[int, tuple[float, float]]) -> ExperimentTable:
    rows = []
    for d in swept.values(DELAY):
        for links in swept.values(LINKS):
            found = list(swept.where({DELAY: d, LINKS: links}))
            cells = []
            for number, (index, _) in enumerate(INDEXES):
                times = _of(swept, found, index)
                predicted = float(np.median([said[row["sample"]][number] for row in found]))
                cells += [predicted, float(np.median(times)), float(times.min()), float(times.max())]
            rows.append((d, links, len(found), *cells))
    columns = ["delay (s)", "links", "graphs"]
    columns += [f"{w}, {h} (s)" for w in ("f", "sharing") for h in ("predicted", "median", "lowest", "highest")]
    return ExperimentTable(columns=columns, rows=rows)


def _of(swept: SweepData, rows: Sequence[RunColumns], index: str) -> Floats:
    return np.array([swept.measure(row, index) for row in rows])


def _medians(said: Mapping[int, tuple[float, float]], rows: Sequence[RunColumns], at: Floats, number: int) -> Floats:
    return np.array([np.median([said[row["sample"]][number] for row in rows if row[LINKS] == x]) for x in at])


def _said(swept: SweepData, row: RunColumns) -> tuple[float, float]:
    """Return the predicted times of one random graph."""
    return of_times(predicted_times(fleet_on(swept, row["graph.edges"]), link_delay_s=row[DELAY], load=swept.load))


def fleet_on(swept: SweepData, edges: str) -> InverterGroup:
    """Return the inverters on a graph of the sweep, written "inv1-inv2 inv2-inv5 ..."."""
    case = next(iter(swept.base.cases))
    first, rest = zip(*(edge.split("-") for edge in edges.split()), strict=True)
    control = Control(secondary="all", graph="links", links=tuple(zip(first, rest, strict=True)))
    rows = {inverter.name: inverter for inverter in swept.feeder.inverters}
    return replace(swept.fleet(case), A=np.array(adjacency(control, rows)))
