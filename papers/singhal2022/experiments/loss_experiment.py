"""Lost messages: times against the probability of loss, and against delays of the same mean age of used states.

With hold, a state is used until the next one comes. If each is lost with probability p, the mean age is T_c/(1 - p):
the one period that every state takes, and T_c p/(1 - p) more.
"""

from __future__ import annotations

import numpy as np

from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES, SweepData
from gridpeers.papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Page,
    TableCell,
    time_panels,
)

DELAY, LOSS = "link[0].delay", "link[0].loss"


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
            x, y = sweep.curve(LOSS, index, {"case": case, DELAY: 0.0})
            low, high = (sweep.curve(LOSS, index, {"case": case, DELAY: 0.0}, over)[1] for over in (np.min, np.max))
            found += [
                Curve(x, y, style, low=low, high=high),
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
        names={style: sweep.base.cases[case].title for style, case in enumerate(cases)},
        looks={"measured": "loss: median and range of 3 seeds", "hollow": "delay", "predicted": "predicted"},
    )
    rows: list[list[TableCell]] = []
    for case in cases:
        for p, age in zip(lost, age_of_loss.tolist(), strict=True):
            row: list[TableCell] = [case, p, age]
            same_age = next((d for d in sweep.values(DELAY) if abs(d - age) < 1e-9), 0.0 if p == 0.0 else None)
            predicted = sweep.predicted(case, loss=p)
            for number, (index, _) in enumerate(INDEXES):
                late_cell = "" if same_age is None else sweep.median(index, {"case": case, DELAY: same_age, LOSS: 0.0})
                row += [predicted[number], sweep.median(index, {"case": case, DELAY: 0.0, LOSS: p}), late_cell]
            rows.append(row)
    columns = ["graph", "loss", "mean age (s)"]
    columns += [f"{w}, {how} (s)" for w in ("f", "sharing") for how in ("predicted", "measured", "delay of that age")]
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows))
