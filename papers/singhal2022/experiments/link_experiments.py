"""Late and lossy links: times to restore f and to share power against delay, loss, number of links and options; swings.

With hold, a state is used until the next one comes. If each is lost with probability p, the mean age is T_c/(1 - p):
the one period that every state takes, and T_c p/(1 - p) more.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from gridpeers import theory
from gridpeers.measures import Flags, Floats
from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES, SweepData, times_of
from gridpeers.papers.singhal2022.experiments.experiment_output import Curve, ExperimentResult, Page, Panel, time_panels
from gridpeers.theory import InverterGroup, var_growth

DELAY, LOSS, K_Q, ON = "link[0].delay", "link[0].loss", "gains.k_q", "link[0].on"
WHOLE, ALONE = 0.25, 1e5
"""k_q of the whole law, and of one that leaves V_set alone."""

X = "delay of every agent-agent link (s)"


def delay(sweep: SweepData) -> ExperimentResult:
    """Return the times against delay, measured and predicted."""
    cases, delays = list(sweep.base.cases)[:4], sweep.values(DELAY)
    fine = np.unique(np.concatenate([delays, np.round(np.geomspace(0.02, 1.0, 12), 2)])).tolist()

    def curves(index: str, style: int, case: str) -> Iterator[Curve]:
        yield Curve(*sweep.curve(DELAY, index, {"case": case, K_Q: WHOLE}), style)
        yield Curve(*sweep.curve(DELAY, index, {"case": case, K_Q: ALONE}), style, "hollow")
        yield Curve(*sweep.theory(index, case, link_delay_s=fine), style, "predicted")

    page = Page(
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


LEFT: Mapping[str, Mapping[str, Any]] = {
    "V_error": {"y_label": "mean of abs(V - 1) (pu)", "y_range": (0.0, 0.012)},
    "MQSI": {"y_label": "var sharing index, MQSI", "log": "y", "y_range": (0.003, 1.0)},
}
"""Steady values with their axes."""

AT_THE_END = {
    "f_error_Hz": "abs(f - 60) (Hz)",
    "MPSI": "MPSI",
    "V_error": "V_error (pu)",
    "MQSI": "MQSI",
    "V_swing_pu": "swing of V (pu)",
}
"""Columns of the table of `communication`."""


def communication(sweep: SweepData) -> ExperimentResult:
    """Return the times and steady values against delay, for every case of the scenario."""
    cases, delays = sweep.rows["case"].unique().tolist(), sweep.values(DELAY)

    def curves(index: str, style: int, case: str) -> Iterator[Curve]:
        yield Curve(*sweep.curve(DELAY, index, {"case": case}), style)
        yield Curve(*sweep.theory(index, case, link_delay_s=delays), style, "predicted")

    panels = time_panels(cases, curves, x_label=X, log="y", y_range=(0.3, 25.0))
    for index, axes in LEFT.items():
        lines = [Curve(*sweep.curve(DELAY, index, {"case": case}), style) for style, case in enumerate(cases)]
        panels.append(Panel(title=f"{index} at the end of the run", x_label=X, curves=lines, **axes))
    page = Page(
        title="Islanding with the paper's reduced communication and link failure, over late links",
        panels=panels,
        columns=2,
        names={style: f"{case}: {sweep.base.cases[case].title}" for style, case in enumerate(cases)},
        height=2.6,
    )
    rows = []
    for case, d in product(cases, delays):
        rows.append(row := {"case": case, "delay (s)": d})
        for index, (what, _) in INDEXES.items():
            row[f"{what}, predicted (s)"] = sweep.predicted(case, link_delay_s=d)[index]
            row[f"{what} (s)"] = sweep.median(index, {"case": case, DELAY: d})
        row |= {name: round(sweep.median(of, {"case": case, DELAY: d}), 4) for of, name in AT_THE_END.items()}
        growth = var_growth(sweep.inverters[case], sweep.response, link_delay_s=d)
        row["growth of vars, predicted (1/s)"] = round(growth, 2)
    return ExperimentResult(page, rows, digits=2)


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
    page = Page(
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


GRAPH_LINKS = "graph.links"


def topology(sweep: SweepData) -> ExperimentResult:
    """Return the times against the number of links, with and without delay, measured and predicted."""
    predicted = [
        times_of(theory.predicted_times(on_graph(sweep, edges), link_delay_s=d, load=sweep.load))
        for edges, d in zip(sweep.rows["graph.edges"], sweep.rows[DELAY], strict=True)
    ]
    runs = sweep.rows.assign(**{index: [times[index] for times in predicted] for index in INDEXES})

    def curves(index: str, style: int, d: float) -> Iterator[Curve]:
        x, y = sweep.curve(GRAPH_LINKS, index, {DELAY: d})
        low, high = sweep.range(GRAPH_LINKS, index, {DELAY: d})
        rows = runs[runs[DELAY] == d]
        at = (rows[GRAPH_LINKS] + 0.25 * (-1.0) ** rows["graph.number"]).to_numpy(float)
        yield Curve(x, y, style, low=low, high=np.minimum(high, 1e3))
        yield Curve(at, sweep.measured(index, rows), style, "points")
        yield Curve(x, rows.groupby(GRAPH_LINKS)[index].median().to_numpy(), style, "predicted")

    delays, links = sweep.values(DELAY), "links of the communication graph"
    page = Page(
        title="Random connected graphs",
        panels=time_panels(delays, curves, x_label=links, log="y", x_ticks=range(8, 37, 4), y_range=(0.3, 15.0)),
        columns=2,
        names={style: f"links late by {d:g} s" if d else "links at once" for style, d in enumerate(delays)},
        looks={"measured": "median and range", "points": "a graph", "predicted": "predicted, median"},
        share_y=True,
    )
    table = []
    for (d, count), rows in runs.groupby([DELAY, GRAPH_LINKS]):
        table.append(row := {"delay (s)": d, "links": count, "graphs": len(rows)})
        for index, (what, _) in INDEXES.items():
            times = sweep.measured(index, rows)
            row[f"{what}, predicted (s)"] = rows[index].median()
            row[f"{what}, median (s)"] = np.median(times)
            row |= {f"{what}, lowest (s)": times.min(), f"{what}, highest (s)": times.max()}
    return ExperimentResult(page, table)


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
        panel = Panel(
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
    page = Page(
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
        if var_growth(inverters, sweep.response, link_delay_s=n * T_c) > 0.0:
            return round((n - 1) * T_c, 9)
    return np.inf


def _between(x: Floats, calm: Flags) -> tuple[float, float]:
    """Return the last delay up to which all is calm, and the next one; infinite where nothing ever swings."""
    first = int(np.argmin(calm)) if not calm.all() else len(x)
    return float(x[first - 1]) if first else 0.0, float(x[first]) if first < len(x) else np.inf


OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "hold (paper)": {},
    "skip": {"stale": "skip"},
    "age-weighted, 50 ms": {"stale": "age-weighted", "T_age_s": 0.05},
    "age-weighted, 200 ms": {"stale": "age-weighted"},
    "degree-normalised": {"weights": "degree-normalised"},
    "degree-norm., kappa_c 24": {"weights": "degree-normalised", "kappa_c": 24.0},
    "degree-norm. + age 200 ms": {"weights": "degree-normalised", "stale": "age-weighted"},
    "no limits on P_set, V_set": {"anti_windup": "none"},
    "conditional anti-windup": {"anti_windup": "conditional"},
}
"""Options of `[degraded_communication]` in the sweep, by name; keys that they leave out are as in the paper."""

_PAPER = {"stale": "hold", "T_age_s": 0.2, "weights": "paper", "kappa_c": 12.0, "anti_windup": "clamp"}


def degraded_communication(sweep: SweepData) -> ExperimentResult:
    """Return the times of every option under every delay and loss."""
    cases, conditions = GRAPHS[:3], sweep.rows["link"].unique().tolist()

    def predicted(case: str, links: str) -> dict[str, float]:
        late_s, lost = _condition(links)
        return sweep.predicted(case, link_delay_s=late_s, loss=lost)

    def measured(case: str, links: str, option: str, index: str) -> float:
        options = {f"degraded_communication.{key}": value for key, value in (_PAPER | dict(OPTIONS[option])).items()}
        (value,) = sweep.measured(index, sweep.where({"case": case, "link": links, **options}))
        return float(value)

    panels = []
    for (index, (_, title)), links in product(INDEXES.items(), conditions):
        curves = []
        for style, case in enumerate(cases):
            x = np.arange(float(len(OPTIONS))) + 0.18 * (style - 1)
            y = np.array([measured(case, links, option, index) for option in OPTIONS])
            curves += [Curve(x, y, style, "points")]
            curves += [Curve(x[:1], np.array([predicted(case, links)[index]]), style, "hollow")]
        panel = Panel(
            title=condition_words(*_condition(links)),
            x_label="",
            y_label=f"{title.partition(',')[0]}, time (s)" if links == conditions[0] else "",
            curves=curves,
            log="y",
            x_names=list(OPTIONS) if index == "t_share_s" else [""] * len(OPTIONS),
            y_range=(0.2, 30.0),
        )
        panels.append(panel)
    page = Page(
        title="Islanding over late and lossy links, with every option of the agents",
        panels=panels,
        columns=len(conditions),
        names=sweep.names(cases),
        looks={"points": "measured", "hollow": "predicted (hold)"},
        share_y=True,
        height=2.6,
    )
    rows = []
    for case, links in product(cases, conditions):
        by_option = {"hold, predicted": predicted(case, links)}
        by_option |= {name: {index: measured(case, links, name, index) for index in INDEXES} for name in OPTIONS}
        of = {"graph": case, "links": condition_words(*_condition(links))}
        for option, times in by_option.items():
            rows.append({**of, "option": option, "f (s)": times["t_f_s"], "sharing (s)": times["t_share_s"]})
    return ExperimentResult(page, rows)


def condition_words(late: float, lost: float) -> str:
    """Return a delay (s) and a loss of all agent-agent links in words.

    >>> condition_words(0.1, 0.0), condition_words(0.0, 0.9), condition_words(0.0, 0.0)
    ('late by 0.1 s', 'loss 90 %', 'good links')
    """
    return f"late by {late:g} s" if late else f"loss {100 * lost:g} %" if lost else "good links"


def _condition(links: str) -> tuple[float, float]:
    entries = json.loads(links)
    return (entries[0].get("delay", 0.0), entries[0].get("loss", 0.0)) if entries else (0.0, 0.0)
