"""The same delay between agents, of measurements, and of set-points: which quantity swings, and from which delay on.

The links carry frequency and voltage together. Mostly the voltage swings first; to see the frequency by itself,
the sweep has runs that leave V_set alone.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from gridpeers.measures import Flags, Floats
from gridpeers.papers.singhal2022.experiments.experiment_data import SweepData
from gridpeers.papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    LimitLine,
    Page,
    Panel,
)
from gridpeers.papers.singhal2022.experiments.link_experiments import ALONE, DELAY, K_Q, WHOLE
from gridpeers.theory import delay_limit, var_delay_limit, var_growth

ON = "link[0].on"

LINKS, MEASUREMENTS, SET_POINTS = "* <-> *", "plant -> *", "* -> plant"

CASES = ("full", "reduced", "path", "star")

LEVELS = {"f_swing_Hz": 0.005, "V_swing_pu": 0.002}
"""Least swing that counts (Hz, pu). An oscillation that stays is ten times as large."""

LEAST = 1e-5
"""Swings below this (Hz, pu) are drawn as this: the rest of a transient, or rounding."""

_PLACES = ((LINKS, "links"), (MEASUREMENTS, "measurements"), (SET_POINTS, "set-points"))

_ROWS = (
    ("f_swing_Hz", "f, V_set left alone", "swing of f (Hz)", ALONE),
    ("V_swing_pu", "V, whole law", "swing of V (pu)", WHOLE),
)
"""Rows of the figure: frequency where the voltage is left alone, and voltage where nothing is."""


def places(sweep: SweepData) -> ExperimentResult:
    """Return the swing at the end of the run against delay, for each place, with predicted limits."""
    limits = _limits(sweep)
    panels, rows = [], []
    for (index, title, y_label, k_q), (on, place) in product(_ROWS, _PLACES):
        curves, lines = [], []
        for style, case in enumerate(CASES):
            x, y = sweep.curve(DELAY, index, {"case": case, ON: on, K_Q: k_q})
            curves.append(Curve(x, np.maximum(y, LEAST), style))
            limit = limits[index, on != LINKS, case]
            if np.isfinite(limit) and limit <= x[-1]:
                lines.append(LimitLine(x=limit, style=style))
            rows.append((title, place, case, limit, *_between(x, y < LEVELS[index])))
        panels.append(
            Panel(
                title=f"{title}: late {place}",
                x_label=f"delay of {place} (s)",
                y_label=y_label,
                curves=curves,
                lines=lines,
                level=LEVELS[index],
                log="y",
                x_range=(-0.01, 0.62),
                y_range=(LEAST, 1.0),
            )
        )
    page = Page(
        title="Where a delay sits decides whether it destabilises",
        panels=panels,
        columns=3,
        names={style: sweep.base.cases[case].title for style, case in enumerate(CASES)},
        looks={},
        height=2.9,
    )
    columns = ("what swings", "late", "graph", "predicted limit (s)", "calm up to (s)", "swings from (s)")
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows))


def _limits(sweep: SweepData) -> dict[tuple[str, bool, str], float]:
    """Return the predicted limits (s) by the quantity that swings, whether links of the plant are late, and graph."""
    found = {}
    for case in CASES:
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
