"""Late and lossy links: times to restore f and to share power against delay, loss and the number of links; swings.

With hold, a state is used until the next one comes. If each is lost with probability p, the mean age is T_c/(1 - p):
the one period that every state takes, and T_c p/(1 - p) more.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from gridpeers.measures import Flags, Floats
from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES, SweepData, times_of
from gridpeers.papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Page,
    Panel,
    TableCell,
    time_panels,
)
from gridpeers.theory import InverterGroup, delay_limit, predicted_times, var_delay_limit, var_growth

DELAY, LOSS, K_Q, ON = "link[0].delay", "link[0].loss", "gains.k_q", "link[0].on"
WHOLE, ALONE = 0.25, 1e5
"""k_q of the whole law, and of one that leaves V_set alone."""

X = "delay of every agent-agent link (s)"


def delay(sweep: SweepData) -> ExperimentResult:
    """Return the times against delay, measured and predicted."""
    cases, delays = list(sweep.base.cases)[:4], sweep.values(DELAY)
    fine = np.unique(np.concatenate([delays, np.round(np.geomspace(0.02, 1.0, 12), 2)]))
    theory = {(case, d): sweep.predicted(case, link_delay_s=d) for case in cases for d in fine.tolist()}

    def curves(number: int, index: str) -> list[Curve]:
        found = []
        for style, case in enumerate(cases):
            predicted = np.array([theory[case, d][number] for d in fine.tolist()])
            found += [
                Curve(*sweep.curve(DELAY, index, {"case": case, K_Q: WHOLE}), style),
                Curve(*sweep.curve(DELAY, index, {"case": case, K_Q: ALONE}), style, "hollow"),
                Curve(fine, predicted, style, "predicted"),
            ]
        return found

    page = Page(
        title="Islanding over late links",
        panels=time_panels(curves, x_label=X, log="xy", zero=0.02, x_ticks=delays, y_range=(0.3, 40.0)),
        columns=2,
        names=sweep.names(cases),
        looks={"measured": "measured", "hollow": "measured, V_set left alone", "predicted": "predicted"},
        share_y=True,
    )
    rows: list[list[TableCell]] = []
    for case, d in product(cases, delays):
        row: list[TableCell] = [case, d]
        for number, (index, _) in enumerate(INDEXES):
            measured = [sweep.median(index, {"case": case, DELAY: d, K_Q: k}) for k in (ALONE, WHOLE)]
            row += [theory[case, d][number], *measured]
        rows.append(row)
    columns = ["graph", "delay (s)", *_of_times("predicted", "V_set left alone", "whole law")]
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows))


def _of_times(*kinds: str) -> list[str]:
    """Return columns for kinds of each of the two times."""
    return [f"{what}, {kind} (s)" for what in ("f", "sharing") for kind in kinds]


LEFT: tuple[tuple[str, dict[str, Any]], ...] = (
    ("V_error", {"y_label": "mean of abs(V - 1) (pu)", "y_range": (0.0, 0.012)}),
    ("MQSI", {"y_label": "var sharing index, MQSI", "log": "y", "y_range": (0.003, 1.0)}),
)
"""Steady values with their axes."""


def communication(sweep: SweepData) -> ExperimentResult:
    """Return the times and steady values against delay, for every case of the scenario."""
    cases, delays = sweep.rows["case"].unique().tolist(), sweep.values(DELAY)
    theory = {(case, d): sweep.predicted(case, link_delay_s=d) for case in cases for d in delays}

    def curves(number: int, index: str) -> list[Curve]:
        found = []
        for style, case in enumerate(cases):
            x, y = sweep.curve(DELAY, index, {"case": case})
            predicted = np.array([theory[case, d][number] for d in delays])
            found += [Curve(x, y, style), Curve(x, predicted, style, "predicted")]
        return found

    panels = time_panels(curves, x_label=X, log="y", y_range=(0.3, 25.0))
    for index, axes in LEFT:
        lines = [Curve(*sweep.curve(DELAY, index, {"case": case}), style) for style, case in enumerate(cases)]
        panels.append(Panel(title=f"{index} at the end of the run", x_label=X, curves=lines, **axes))
    page = Page(
        title="Islanding with the paper's reduced communication and link failure, over late links",
        panels=panels,
        columns=2,
        names={style: f"{case}: {sweep.base.cases[case].title}" for style, case in enumerate(cases)},
        height=2.6,
    )
    rows: list[list[TableCell]] = []
    for case, d in product(cases, delays):
        row: list[TableCell] = [case, d]
        for number, (index, _) in enumerate(INDEXES):
            row += [theory[case, d][number], sweep.median(index, {"case": case, DELAY: d})]
        for name in ("f_error_Hz", "MPSI", "V_error", "MQSI", "V_swing_pu"):
            row.append(round(sweep.median(name, {"case": case, DELAY: d}), 4))
        rows.append([*row, round(var_growth(sweep.inverters[case], sweep.response, link_delay_s=d), 2)])
    columns = (
        *("case", "delay (s)", "f, predicted (s)", "f (s)", "sharing, predicted (s)", "sharing (s)"),
        *("abs(f - 60) (Hz)", "MPSI", "V_error (pu)", "MQSI", "swing of V (pu)", "growth of vars, predicted (1/s)"),
    )
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows, digits=2))


def loss(sweep: SweepData) -> ExperimentResult:
    """Return the times against loss, and against mean age, measured and predicted."""
    cases, T_c = list(sweep.base.cases)[:4], sweep.base.time.T_c_s
    lost, late = sweep.values(LOSS, {DELAY: 0.0}), sweep.values(DELAY, {LOSS: 0.0})[1:]
    age_of_loss, ages = np.array([T_c / (1.0 - p) for p in lost]), np.array([T_c, *late])
    fine = np.linspace(0.0, 0.96, 25)
    by_loss = {case: np.array([sweep.predicted(case, loss=p) for p in fine.tolist()]) for case in cases}
    by_age = {case: np.array([sweep.predicted(case, link_delay_s=d) for d in ages.tolist()]) for case in cases}

    def against_loss(number: int, index: str) -> list[Curve]:
        found = []
        for style, case in enumerate(cases):
            of = {"case": case, DELAY: 0.0}
            found += [
                Curve(*sweep.curve(LOSS, index, of), style, "measured", *sweep.range(LOSS, index, of)),
                Curve(fine, by_loss[case][:, number], style, "predicted"),
            ]
        return found

    def against_age(number: int, index: str) -> list[Curve]:
        found = []
        for style, case in enumerate(cases):
            x, y = sweep.curve(DELAY, index, {"case": case, LOSS: 0.0})
            found += [
                Curve(age_of_loss, sweep.curve(LOSS, index, {"case": case, DELAY: 0.0})[1], style, "points"),
                Curve(np.maximum(x, T_c), y, style, "hollow"),
                Curve(ages, by_age[case][:, number], style, "predicted"),
            ]
        return found

    panels = time_panels(against_loss, x_label="probability p that a message is lost", log="y", y_range=(0.3, 25.0))
    panels += time_panels(
        against_age,
        ", against mean age",
        x_label="mean age of what is used: delay, or T_c/(1 - p) (s)",
        log="xy",
        x_ticks=[0.02, 0.04, 0.1, 0.2, 0.4],
        y_range=(0.3, 25.0),
    )
    page = Page(
        title="Islanding over lossy links, the last state held",
        panels=panels,
        columns=2,
        names=sweep.names(cases),
        looks={"measured": "loss: median and range of 3 seeds", "hollow": "delay", "predicted": "predicted"},
    )
    rows: list[list[TableCell]] = []
    for case, (p, age) in product(cases, zip(lost, age_of_loss.tolist(), strict=True)):
        row: list[TableCell] = [case, p, age]
        same_age = next((d for d in sweep.values(DELAY) if abs(d - age) < 1e-9), 0.0 if p == 0.0 else None)
        predicted = sweep.predicted(case, loss=p)
        for number, (index, _) in enumerate(INDEXES):
            late_cell = "" if same_age is None else sweep.median(index, {"case": case, DELAY: same_age, LOSS: 0.0})
            row += [predicted[number], sweep.median(index, {"case": case, DELAY: 0.0, LOSS: p}), late_cell]
        rows.append(row)
    columns = ["graph", "loss", "mean age (s)", *_of_times("predicted", "measured", "delay of that age")]
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows))


GRAPH_LINKS = "graph.links"
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
            x, y = sweep.curve(GRAPH_LINKS, index, {DELAY: d})
            low, high = sweep.range(GRAPH_LINKS, index, {DELAY: d})
            rows = runs[runs[DELAY] == d]
            at = (rows[GRAPH_LINKS] + 0.25 * (-1.0) ** rows["graph.number"]).to_numpy(float)
            medians = rows.groupby(GRAPH_LINKS)[PREDICTED[number]].median().to_numpy()
            found += [
                Curve(x, y, style, low=low, high=np.minimum(high, 1e3)),
                Curve(at, sweep.measured(index, rows), style, "points"),
                Curve(x, medians, style, "predicted"),
            ]
        return found

    links = "links of the communication graph"
    page = Page(
        title="Random connected graphs",
        panels=time_panels(curves, x_label=links, log="y", x_ticks=range(8, 37, 4), y_range=(0.3, 15.0)),
        columns=2,
        names={style: f"links late by {d:g} s" if d else "links at once" for style, d in enumerate(delays)},
        looks={"measured": "median and range", "points": "a graph", "predicted": "predicted, median"},
        share_y=True,
    )
    table: list[list[TableCell]] = []
    for (d, count), rows in runs.groupby([DELAY, GRAPH_LINKS]):
        row: list[TableCell] = [d, count, len(rows)]
        for number, (index, _) in enumerate(INDEXES):
            times = sweep.measured(index, rows)
            predicted = rows[PREDICTED[number]].median()
            row += [float(x) for x in (predicted, np.median(times), times.min(), times.max())]
        table.append(row)
    columns = ["delay (s)", "links", "graphs", *_of_times("predicted", "median", "lowest", "highest")]
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=table))


def on_graph(sweep: SweepData, edges: str) -> InverterGroup:
    """Return the inverters on a graph of the sweep, written "inv1-inv2 inv2-inv5 ..."."""
    index = {inverter.name: i for i, inverter in enumerate(sweep.feeder.inverters)}
    A = np.zeros((len(index), len(index)))
    for edge in edges.split():
        i, j = (index[name] for name in edge.split("-"))
        A[i, j] = A[j, i] = 1.0
    return replace(next(iter(sweep.inverters.values())), A=A)


GRAPHS = ("full", "reduced", "path", "star")
LINKS = "* <-> *"
PLACES = ((LINKS, "links"), ("plant -> *", "measurements"), ("* -> plant", "set-points"))

SWINGS = (
    ("f_swing_Hz", 0.005, "f, V_set left alone", "swing of f (Hz)", ALONE),
    ("V_swing_pu", 0.002, "V, whole law", "swing of V (pu)", WHOLE),
)
"""Rows of the figure: a swing, the least that counts (an oscillation that stays is ten times as large), title, label of
the axis, and k_q of the runs. The voltage is left alone in the first, and controlled in the second."""

LEAST = 1e-5
"""Swings below this (Hz, pu) are drawn as this: the rest of a transient, or rounding."""


def places(sweep: SweepData) -> ExperimentResult:
    """Return the swing at the end of the run against delay, for each place, with predicted limits.

    The links carry frequency and voltage together. Mostly the voltage swings first; to see the frequency by itself,
    the sweep has runs that leave V_set alone.
    """
    limits = _limits(sweep)
    panels, rows = [], []
    for (index, least, title, y_label, k_q), (on, place) in product(SWINGS, PLACES):
        curves, lines = [], []
        for style, case in enumerate(GRAPHS):
            x, y = sweep.curve(DELAY, index, {"case": case, ON: on, K_Q: k_q})
            curves.append(Curve(x, np.maximum(y, LEAST), style))
            limit = limits[index, on != LINKS, case]
            if np.isfinite(limit) and limit <= x[-1]:
                lines.append((limit, style))
            rows.append((title, place, case, limit, *_between(x, y < least)))
        panels.append(
            Panel(
                title=f"{title}: late {place}",
                x_label=f"delay of {place} (s)",
                y_label=y_label,
                curves=curves,
                lines=lines,
                level=least,
                log="y",
                x_range=(-0.01, 0.62),
                y_range=(LEAST, 1.0),
            )
        )
    page = Page(
        title="Where a delay sits decides whether it destabilises",
        panels=panels,
        columns=3,
        names=sweep.names(GRAPHS),
        looks={},
        height=2.9,
    )
    columns = ("what swings", "late", "graph", "predicted limit (s)", "calm up to (s)", "swings from (s)")
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows))


def _limits(sweep: SweepData) -> dict[tuple[str, bool, str], float]:
    """Return the predicted limits (s) by the quantity that swings, whether links of the plant are late, and graph."""
    found = {}
    for case in GRAPHS:
        inverters = sweep.inverters[case]
        found["f_swing_Hz", False, case] = delay_limit(inverters, "neighbours", longest_s=1.0)
        found["f_swing_Hz", True, case] = delay_limit(inverters, "local loop", longest_s=1.0)
        found["V_swing_pu", False, case] = _var_link_limit(sweep, case)
        found["V_swing_pu", True, case] = var_delay_limit(inverters, sweep.response)
    return found


def _var_link_limit(sweep: SweepData, case: str) -> float:
    """Return the longest delay (s) of the links up to which the var law decays; infinite: all of the sweep."""
    T_c = sweep.base.time.T_c_s
    for n in range(1, round(max(sweep.values(DELAY)) / T_c) + 1):
        if var_growth(sweep.inverters[case], sweep.response, link_delay_s=n * T_c) > 0.0:
            return round((n - 1) * T_c, 9)
    return np.inf


def _between(x: Floats, calm: Flags) -> tuple[float, float]:
    """Return the last delay up to which all is calm, and the next one; infinite where nothing ever swings."""
    first = int(np.argmin(calm)) if not calm.all() else len(x)
    return float(x[first - 1]) if first else 0.0, float(x[first]) if first < len(x) else np.inf
