"""Late and lossy links: times to restore f and to share power against delay and loss; swings.

With hold, a state is used until the next one comes. If each is lost with probability p, the mean age is T_c/(1 - p):
the one period that every state takes, and T_c p/(1 - p) more.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from gridpeers import theory
from gridpeers.measures import Flags, Floats
from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES, SweepData
from gridpeers.papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    PlotPage,
    PlotPanel,
    time_panels,
)

DELAY, LOSS, K_Q, ON = "link[0].delay", "link[0].loss", "gains.k_q", "link[0].on"
WHOLE, ALONE = 0.25, 1e5  # k_q of the whole law, and of one that leaves V_set alone

X = "delay of every agent-agent link (s)"


def delay(sweep: SweepData) -> ExperimentResult:
    """Return the times against delay, measured and predicted."""
    cases, delays = list(sweep.base.cases)[:4], sweep.values(DELAY)
    fine = np.unique(np.concatenate([delays, np.round(np.geomspace(0.02, 1.0, 12), 2)])).tolist()

    def curves(index: str, style: int, case: str) -> Iterator[Curve]:
        yield Curve(*sweep.curve(DELAY, index, {"case": case, K_Q: WHOLE}), style)
        yield Curve(*sweep.curve(DELAY, index, {"case": case, K_Q: ALONE}), style, "hollow")
        yield Curve(*sweep.theory(index, case, link_delay_s=fine), style, "predicted")

    page = PlotPage(
        title="Islanding over late links",
        panels=time_panels(cases, curves, x_label=X, log="xy", zero=0.02, x_ticks=delays, y_range=(0.3, 40.0)),
        columns=2,
        names=sweep.names(cases),
        looks={"measured": "measured", "hollow": "measured, V_set left alone", "predicted": "predicted"},
        share_y=True,
    )
    rows = []
    for case, d in product(cases, delays):
        rows.append(row := {"graph": case, "delay (s)": d})
        for index, (what, _) in INDEXES.items():
            row[f"{what}, predicted (s)"] = sweep.predicted(case, link_delay_s=d)[index]
            row[f"{what}, V_set left alone (s)"] = sweep.median(index, {"case": case, DELAY: d, K_Q: ALONE})
            row[f"{what}, whole law (s)"] = sweep.median(index, {"case": case, DELAY: d, K_Q: WHOLE})
    return ExperimentResult(page, rows)


def loss(sweep: SweepData) -> ExperimentResult:
    """Return the times against loss, and against mean age, measured and predicted."""
    cases, T_c = list(sweep.base.cases)[:4], sweep.base.time.T_c_s
    lost, late = sweep.values(LOSS, {DELAY: 0.0}), sweep.values(DELAY, {LOSS: 0.0})
    age_of_loss = [T_c / (1.0 - p) for p in lost]

    def against_loss(index: str, style: int, case: str) -> Iterator[Curve]:
        of = {"case": case, DELAY: 0.0}
        yield Curve(*sweep.curve(LOSS, index, of), style, "measured", *sweep.range(LOSS, index, of))
        yield Curve(*sweep.theory(index, case, loss=np.linspace(0.0, 0.96, 25).tolist()), style, "predicted")

    def against_age(index: str, style: int, case: str) -> Iterator[Curve]:
        _, y = sweep.curve(LOSS, index, {"case": case, DELAY: 0.0})
        yield Curve(np.array(age_of_loss), y, style, "points")
        x, y = sweep.curve(DELAY, index, {"case": case, LOSS: 0.0})
        yield Curve(np.maximum(x, T_c), y, style, "hollow")
        yield Curve(*sweep.theory(index, case, link_delay_s=[T_c, *late[1:]]), style, "predicted")

    range_s = (0.3, 25.0)
    by_loss: dict[str, Any] = {"x_label": "probability p that a message is lost", "log": "y", "y_range": range_s}
    by_age: dict[str, Any] = {"x_label": "mean age of what is used: delay, or T_c/(1 - p) (s)", "y_range": range_s}
    by_age |= {"log": "xy", "x_ticks": [0.02, 0.04, 0.1, 0.2, 0.4], "suffix": ", against mean age"}
    page = PlotPage(
        title="Islanding over lossy links, the last state held",
        panels=[*time_panels(cases, against_loss, **by_loss), *time_panels(cases, against_age, **by_age)],
        columns=2,
        names=sweep.names(cases),
        looks={"measured": "loss: median and range of 3 seeds", "hollow": "delay", "predicted": "predicted"},
    )
    rows = []
    for case, (p, age) in product(cases, zip(lost, age_of_loss, strict=True)):
        rows.append(row := {"graph": case, "loss": p, "mean age (s)": age})
        same = next((d for d in sweep.values(DELAY) if abs(d - age) < 1e-9), 0.0 if p == 0.0 else None)
        for index, (what, _) in INDEXES.items():
            row[f"{what}, predicted (s)"] = sweep.predicted(case, loss=p)[index]
            row[f"{what}, measured (s)"] = sweep.median(index, {"case": case, DELAY: 0.0, LOSS: p})
            of_delay = "" if same is None else sweep.median(index, {"case": case, DELAY: same, LOSS: 0.0})
            row[f"{what}, delay of that age (s)"] = of_delay
    return ExperimentResult(page, rows)


GRAPHS = ("full", "reduced", "path", "star")
LINKS = "* <-> *"
PLACES = ((LINKS, "links"), ("plant -> *", "measurements"), ("* -> plant", "set-points"))

SWINGS = (
    ("f_swing_Hz", 0.005, "f, V_set left alone", "swing of f (Hz)", ALONE),
    ("V_swing_pu", 0.002, "V, whole law", "swing of V (pu)", WHOLE),
)
"""Rows of the figure: a swing, the least that counts (an oscillation that stays is ten times as large), title, label of
the axis, and k_q of the runs. The voltage is left alone in the first, and controlled in the second."""

LEAST = 1e-5  # Swings below this (Hz, pu) are drawn as this: the rest of a transient, or rounding


def places(sweep: SweepData) -> ExperimentResult:
    """Return the swing at the end of the run against delay, for each place, with predicted limits.

    The links carry frequency and voltage together. Mostly the voltage swings first; to see the frequency by itself,
    the sweep has runs that leave V_set alone.
    """
    panels, rows = [], []
    for (index, least, title, y_label, k_q), (on, place) in product(SWINGS, PLACES):
        curves, lines = [], []
        for style, case in enumerate(GRAPHS):
            x, y = sweep.curve(DELAY, index, {"case": case, ON: on, K_Q: k_q})
            curves.append(Curve(x, np.maximum(y, LEAST), style))
            limit = _limit(sweep, case, index, of_plant=on != LINKS)
            if np.isfinite(limit) and limit <= x[-1]:
                lines.append((limit, style))
            calm_s, swings_s = _between(x, y < least)
            row = {"what swings": title, "late": place, "graph": case, "predicted limit (s)": limit}
            rows.append(row | {"calm up to (s)": calm_s, "swings from (s)": swings_s})
        panel = PlotPanel(
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
        panels.append(panel)
    page = PlotPage(
        title="Where a delay sits decides whether it destabilises",
        panels=panels,
        columns=3,
        names=sweep.names(GRAPHS),
        looks={},
        height=2.9,
    )
    return ExperimentResult(page, rows)


def _limit(sweep: SweepData, case: str, index: str, *, of_plant: bool) -> float:
    """Return the predicted longest delay (s), of links of the plant or between agents, up to which a swing decays."""
    inverters = sweep.inverters[case]
    if index == "f_swing_Hz":
        return theory.delay_limit(inverters, "local loop" if of_plant else "neighbours", longest_s=1.0)
    if of_plant:
        return theory.var_delay_limit(inverters, sweep.response)
    T_c = sweep.base.time.T_c_s
    for n in range(1, round(max(sweep.values(DELAY)) / T_c) + 1):
        if theory.var_growth(inverters, sweep.response, link_delay_s=n * T_c) > 0.0:
            return round((n - 1) * T_c, 9)
    return np.inf


def _between(x: Floats, calm: Flags) -> tuple[float, float]:
    """Return the last calm delay and the next one; infinite without a swing."""
    first = int(np.argmin(calm)) if not calm.all() else len(x)
    return float(x[first - 1]) if first else 0.0, float(x[first]) if first < len(x) else np.inf
