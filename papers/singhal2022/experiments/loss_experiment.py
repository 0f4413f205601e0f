"""Lost messages: times against the probability of loss, and against delays of the same mean age of what is used.

With hold, a state is used until the next one comes. If each is lost with probability p, the mean age is T_c/(1 - p):
the one period that every state takes, and T_c p/(1 - p) more.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gridpeers.theory import predicted_times
from papers.singhal2022.experiments.delay_experiment import INDEXES, of_times
from papers.singhal2022.experiments.experiment_data import SweepData
from papers.singhal2022.experiments.experiment_output import Curve, ExperimentResult, ExperimentTable, Page, Panel

DELAY, LOSS = "link[0].delay", "link[0].loss"


def loss(swept: SweepData) -> ExperimentResult:
    """Return the times against loss, and against mean age, measured and predicted."""
    cases, T_c = list(swept.base.cases)[:4], swept.base.time.T_c_s
    lost, late = swept.values(LOSS, {DELAY: 0.0}), swept.values(DELAY, {LOSS: 0.0})[1:]
    age_of_loss, ages = [T_c / (1.0 - p) for p in lost], [T_c, *late]
    fine = np.linspace(0.0, 0.96, 25)
    said_of_loss = {c: _said(swept, c, losses=fine.tolist()) for c in cases}
    said_of_age = {c: _said(swept, c, delays=ages) for c in cases}
    panels = []
    for number, (index, title) in enumerate(INDEXES):
        curves = []
        for style, case in enumerate(cases):
            x, y = swept.curve(LOSS, index, {"case": case, DELAY: 0.0})
            low, high = (swept.curve(LOSS, index, {"case": case, DELAY: 0.0}, over)[1] for over in (np.min, np.max))
            curves.append(Curve(x=x, y=y, style=style, low=low, high=high))
            curves.append(Curve(x=fine, y=said_of_loss[case][:, number], style=style, look="predicted"))
        panels.append(
            Panel(
                title=title,
                x_label="probability p that a message is lost",
                y_label="time after islanding (s)",
                curves=curves,
                log="y",
                y_range=(0.3, 25.0),
            )
        )
    for number, (index, title) in enumerate(INDEXES):
        curves = []
        for style, case in enumerate(cases):
            _, y = swept.curve(LOSS, index, {"case": case, DELAY: 0.0})
            curves.append(Curve(x=np.array(age_of_loss), y=y, style=style, look="points"))
            x, y = swept.curve(DELAY, index, {"case": case, LOSS: 0.0})
            curves.append(Curve(x=np.maximum(x, T_c), y=y, style=style, look="hollow"))
            curves.append(Curve(x=np.array(ages), y=said_of_age[case][:, number], style=style, look="predicted"))
        panels.append(
            Panel(
                title=f"{title}, against mean age",
                x_label="mean age of what is used: delay, or T_c/(1 - p) (s)",
                y_label="time after islanding (s)",
                curves=curves,
                log="xy",
                x_ticks=[0.02, 0.04, 0.1, 0.2, 0.4],
                y_range=(0.3, 25.0),
            )
        )
    page = Page(
        title="Islanding over lossy links, the last state held",
        panels=panels,
        columns=2,
        names={style: swept.base.cases[case].title for style, case in enumerate(cases)},
        looks={"measured": "loss: median and range of 3 seeds", "hollow": "delay", "predicted": "predicted"},
    )
    return ExperimentResult(page=page, table=_table(swept, cases, lost, T_c))


def _table(swept: SweepData, cases: Sequence[str], lost: Sequence[float], T_c: float) -> ExperimentTable:
    """Each loss beside the delay of its mean age, where that was run."""
    rows = []
    for case in cases:
        for p in lost:
            age = T_c / (1.0 - p)
            d = next((d for d in swept.values(DELAY) if abs(d - age) < 1e-9), 0.0 if p == 0.0 else None)
            said = of_times(predicted_times(swept.fleet(case), loss=p, load=swept.load))
            cells: list[float | str] = []
            for i, (index, _) in enumerate(INDEXES):
                as_late = "" if d is None else swept.median(index, {"case": case, DELAY: d, LOSS: 0.0})
                cells += [said[i], swept.median(index, {"case": case, DELAY: 0.0, LOSS: p}), as_late]
            rows.append((case, p, age, *cells))
    columns = ["graph", "loss", "mean age (s)"]
    columns += [f"{w}, {how} (s)" for w in ("f", "sharing") for how in ("predicted", "measured", "delay of that age")]
    return ExperimentTable(columns=columns, rows=rows)


def _said(
    swept: SweepData, case: str, *, delays: Sequence[float] = (), losses: Sequence[float] = ()
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return the predicted times, a row per delay and loss."""
    fleet = swept.fleet(case)
    late = [predicted_times(fleet, link_delay_s=d, load=swept.load) for d in delays]
    lossy = [predicted_times(fleet, loss=p, load=swept.load) for p in losses]
    return np.array([of_times(times) for times in (*late, *lossy)])
