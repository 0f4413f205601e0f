"""Late links: time to restore f and to share power against the delay of all agent-agent links, on four graphs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from gridpeers.theory import Times, predicted_times, var_growth
from papers.singhal2022.experiments.experiment_data import SweepData
from papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Look,
    Page,
    Panel,
    TableCell,
)

DELAY, K_Q = "link[0].delay", "gains.k_q"
WHOLE, ALONE = 0.25, 1e5
"""k_q of the whole law, and of one that leaves V_set alone."""

INDEXES = (("t_f_s", "Frequency within 0.01 Hz"), ("t_share_s", "Power shared, MPSI < 0.01"))


def delay(swept: SweepData) -> ExperimentResult:
    """Return the times against delay, measured and predicted."""
    cases = list(swept.base.cases)[:4]
    fine = np.unique(np.concatenate([swept.values(DELAY), np.round(np.geomspace(0.02, 1.0, 12), 2)]))
    theory = {(case, d): _predicted(swept, case, d) for case in cases for d in fine.tolist()}
    panels = []
    for number, (index, title) in enumerate(INDEXES):
        curves = []
        for style, case in enumerate(cases):
            x, y = swept.curve(DELAY, index, {"case": case, K_Q: WHOLE})
            curves.append(Curve(x=x, y=y, style=style))
            x, y = swept.curve(DELAY, index, {"case": case, K_Q: ALONE})
            curves.append(Curve(x=x, y=y, style=style, look="hollow"))
            y = np.array([of_times(theory[case, d])[number] for d in fine.tolist()])
            curves.append(Curve(x=fine, y=y, style=style, look="predicted"))
        panels.append(
            Panel(
                title=title,
                x_label="delay of every agent-agent link (s)",
                y_label="time after islanding (s)",
                curves=curves,
                log="xy",
                zero=0.02,
                x_ticks=swept.values(DELAY),
                y_range=(0.3, 40.0),
            )
        )
    rows = []
    for case in cases:
        for d in swept.values(DELAY):
            said = of_times(theory[case, d])
            cells = [
                (said[i], *(swept.median(index, {"case": case, DELAY: d, K_Q: k}) for k in (ALONE, WHOLE)))
                for i, (index, _) in enumerate(INDEXES)
            ]
            rows.append((case, d, *cells[0], *cells[1]))
    columns = ["graph", "delay (s)"]
    columns += [
        f"{what}, {how} (s)" for what in ("f", "sharing") for how in ("predicted", "V_set left alone", "whole law")
    ]
    titles = {style: swept.base.cases[case].title for style, case in enumerate(cases)}
    looks: Mapping[Look, str] = {
        "measured": "measured",
        "hollow": "measured, V_set left alone",
        "predicted": "predicted",
    }
    page = Page(title="Islanding over late links", panels=panels, columns=2, names=titles, looks=looks, share_y=True)
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows))


def of_times(times: Times) -> tuple[float, float]:
    """Return the times to restore and to share (s); infinite for never."""
    return (
        np.inf if times.restore_s is None else times.restore_s,
        np.inf if times.share_s is None else times.share_s,
    )


def _predicted(swept: SweepData, case: str, d: float) -> Times:
    return predicted_times(swept.fleet(case), link_delay_s=d, load=swept.load)


X = "delay of every agent-agent link (s)"

LEFT: tuple[tuple[str, str, Literal["", "y"], tuple[float, float]], ...] = (
    ("V_error", "mean of abs(V - 1) (pu)", "", (0.0, 0.012)),
    ("MQSI", "var sharing index, MQSI", "y", (0.003, 1.0)),
)
"""Steady values, what is written at their axes, and scale and ends of these."""


def communication(swept: SweepData) -> ExperimentResult:
    """Return the times and steady values against delay, for every case of the scenario."""
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
    rows: list[tuple[TableCell, ...]] = []
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
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows, digits=2))
