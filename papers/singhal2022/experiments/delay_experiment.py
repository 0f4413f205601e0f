"""Late links: time to restore f and to share power against the delay of all agent-agent links, on four graphs."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES, SweepData
from gridpeers.papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Page,
    Panel,
    TableCell,
    time_panels,
)
from gridpeers.theory import var_growth

DELAY, K_Q = "link[0].delay", "gains.k_q"
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
        names={style: sweep.base.cases[case].title for style, case in enumerate(cases)},
        looks={"measured": "measured", "hollow": "measured, V_set left alone", "predicted": "predicted"},
        share_y=True,
    )
    rows: list[list[TableCell]] = []
    for case in cases:
        for d in delays:
            row: list[TableCell] = [case, d]
            for number, (index, _) in enumerate(INDEXES):
                measured = [sweep.median(index, {"case": case, DELAY: d, K_Q: k}) for k in (ALONE, WHOLE)]
                row += [theory[case, d][number], *measured]
            rows.append(row)
    columns = ["graph", "delay (s)"]
    columns += [
        f"{what}, {how} (s)" for what in ("f", "sharing") for how in ("predicted", "V_set left alone", "whole law")
    ]
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows))


LEFT: tuple[tuple[str, str, Literal["", "y"], tuple[float, float]], ...] = (
    ("V_error", "mean of abs(V - 1) (pu)", "", (0.0, 0.012)),
    ("MQSI", "var sharing index, MQSI", "y", (0.003, 1.0)),
)
"""Steady values, labels of their axes, and scale and ends of these."""


def communication(sweep: SweepData) -> ExperimentResult:
    """Return the times and steady values against delay, for every case of the scenario."""
    cases, delays = sweep.rows["case"].unique().tolist(), sweep.values(DELAY)
    theory = {(case, d): sweep.predicted(case, link_delay_s=d) for case in cases for d in delays}

    def curves(number: int, index: str) -> list[Curve]:
        found = []
        for style, case in enumerate(cases):
            x, y = sweep.curve(DELAY, index, {"case": case})
            found += [
                Curve(x, y, style),
                Curve(x, np.array([theory[case, d][number] for d in delays]), style, "predicted"),
            ]
        return found

    panels = time_panels(curves, x_label=X, log="y", y_range=(0.3, 25.0))
    for index, y_label, log, y_range in LEFT:
        lines = [Curve(*sweep.curve(DELAY, index, {"case": case}), style) for style, case in enumerate(cases)]
        title = f"{index} at the end of the run"
        panels.append(Panel(title=title, x_label=X, y_label=y_label, curves=lines, log=log, y_range=y_range))
    page = Page(
        title="Islanding with the paper's reduced communication and link failure, over late links",
        panels=panels,
        columns=2,
        names={style: f"{case}: {sweep.base.cases[case].title}" for style, case in enumerate(cases)},
        height=2.6,
    )
    rows: list[list[TableCell]] = []
    for case in cases:
        for d in delays:
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
