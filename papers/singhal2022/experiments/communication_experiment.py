"""The paper's reduced communication and link failure (Table IV) over late links: times, and what is left in the end."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gridpeers.theory import predicted_times, var_growth
from papers.singhal2022.experiments.data.sweep_data import SweepData
from papers.singhal2022.experiments.delay_experiment import DELAY, INDEXES, of_times
from papers.singhal2022.experiments.output.experiment_page import Curve, Page, Panel
from papers.singhal2022.experiments.output.experiment_result import Result
from papers.singhal2022.experiments.output.experiment_table import Cell, Table

X = "delay of every agent-agent link (s)"

LEFT: tuple[tuple[str, str, Literal["", "y"], tuple[float, float]], ...] = (
    ("V_error", "mean of abs(V - 1) (pu)", "", (0.0, 0.012)),
    ("MQSI", "var sharing index, MQSI", "y", (0.003, 1.0)),
)
"""Steady values, what is written at their axes, and scale and ends of these."""


def communication(swept: SweepData) -> Result:
    """Times and steady values against delay, for every case of the scenario."""
    cases, delays = list(dict.fromkeys(row["case"] for row in swept.rows)), swept.values(DELAY)
    said = {
        (case, d): of_times(predicted_times(swept.fleet(case), link_delay_s=d, load=swept.load))
        for case in cases
        for d in delays
    }
    panels = []
    for number, (index, title) in enumerate(INDEXES):
        curves = []
        for style, case in enumerate(cases):
            x, y = swept.curve(DELAY, index, {"case": case})
            curves.append(Curve(x=x, y=y, style=style))
            y = np.array([said[case, d][number] for d in delays])
            curves.append(Curve(x=x, y=y, style=style, look="predicted"))
        y_label = "time after islanding (s)"
        panels.append(Panel(title=title, x_label=X, y_label=y_label, curves=curves, log="y", y_range=(0.3, 25.0)))
    for index, y_label, log, y_range in LEFT:
        curves = []
        for style, case in enumerate(cases):
            x, y = swept.curve(DELAY, index, {"case": case})
            curves.append(Curve(x=x, y=y, style=style))
        title = f"{index} at the end of the run"
        panels.append(Panel(title=title, x_label=X, y_label=y_label, curves=curves, log=log, y_range=y_range))
    page = Page(
        title="Islanding with the paper's reduced communication and link failure, over late links",
        panels=panels,
        columns=2,
        names={style: f"{case}: {swept.base.cases[case].title}" for style, case in enumerate(cases)},
        height=2.6,
    )
    rows: list[tuple[Cell, ...]] = []
    for case in cases:
        for d in delays:
            at = {"case": case, DELAY: d}
            times = [(said[case, d][i], swept.median(index, at)) for i, (index, _) in enumerate(INDEXES)]
            names = ("f_error_Hz", "MPSI", "V_error", "MQSI", "V_swing_pu")
            left = [round(swept.median(name, at), 4) for name in names]
            growth = round(var_growth(swept.fleet(case), swept.response, link_delay_s=d), 2)
            rows.append((case, d, *times[0], *times[1], *left, growth))
    columns = ["case", "delay (s)", "f, predicted (s)", "f (s)", "sharing, predicted (s)", "sharing (s)"]
    columns += [
        "abs(f - 60) (Hz)",
        "MPSI",
        "V_error (pu)",
        "MQSI",
        "swing of V (pu)",
        "growth of vars, predicted (1/s)",
    ]
    return Result(page=page, table=Table(columns=columns, rows=rows, digits=2))
