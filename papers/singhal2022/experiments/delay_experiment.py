"""Late links: time to restore f and to share power against the delay of all agent-agent links, on four graphs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gridpeers.theory import Times, predicted_times
from papers.singhal2022.experiments.data.sweep_data import SweepData
from papers.singhal2022.experiments.output.experiment_page import Curve, Look, Page, Panel
from papers.singhal2022.experiments.output.experiment_result import Result
from papers.singhal2022.experiments.output.experiment_table import Table

DELAY, K_Q = "link[0].delay", "gains.k_q"
WHOLE, ALONE = 0.25, 1e5
"""k_q of the whole law, and of one that leaves V_set alone."""

INDEXES = (("t_f_s", "Frequency within 0.01 Hz"), ("t_share_s", "Power shared, MPSI < 0.01"))


def delay(swept: SweepData) -> Result:
    """Times against delay, measured and predicted."""
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
    return Result(page=page, table=Table(columns=columns, rows=rows))


def of_times(times: Times) -> tuple[float, float]:
    """Times to restore and to share (s); infinite for never."""
    return (
        np.inf if times.restore_s is None else times.restore_s,
        np.inf if times.share_s is None else times.share_s,
    )


def _predicted(swept: SweepData, case: str, d: float) -> Times:
    return predicted_times(swept.fleet(case), link_delay_s=d, load=swept.load)
