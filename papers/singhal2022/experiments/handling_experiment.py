"""What an agent makes of late and lost states: the options of `[handling]`, measured under delay and loss."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from gridpeers.theory import predicted_times
from papers.singhal2022.experiments.delay_experiment import INDEXES, of_times
from papers.singhal2022.experiments.experiment_data import RunColumns, SweepData
from papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Page,
    Panel,
    TableCell,
)

CASES = ("full", "reduced", "path")

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
"""Options of the sweep by name; what they leave out is as in the paper."""

_PAPER = {"stale": "hold", "T_age_s": 0.2, "weights": "paper", "kappa_c": 12.0, "anti_windup": "clamp"}

Condition = tuple[float, float]
"""Delay (s) and loss of all agent-agent links."""


def handling(swept: SweepData) -> ExperimentResult:
    """Return the times of every option under every condition."""
    conditions = list(dict.fromkeys(_condition(row) for row in swept.rows))
    panels: list[Panel] = []
    rows: list[tuple[TableCell, ...]] = []
    for number, (index, title) in enumerate(INDEXES):
        for condition in conditions:
            curves = []
            for style, case in enumerate(CASES):
                y = [_measured(swept, case, condition, option, index) for option in OPTIONS]
                x = np.arange(float(len(OPTIONS))) + 0.18 * (style - 1)
                curves.append(Curve(x=x, y=np.array(y), style=style, look="points"))
                said = _predicted(swept, case, condition)[number]
                curves.append(Curve(x=x[:1], y=np.array([said]), style=style, look="hollow"))
            panels.append(
                Panel(
                    title=words(condition),
                    x_label="",
                    y_label=f"{title.partition(',')[0]}, time (s)" if condition == conditions[0] else "",
                    curves=curves,
                    log="y",
                    x_names=list(OPTIONS) if number else [""] * len(OPTIONS),
                    y_range=(0.2, 30.0),
                )
            )
    for case in CASES:
        for condition in conditions:
            rows.append((case, words(condition), "hold, predicted", *_predicted(swept, case, condition)))
            for option in OPTIONS:
                times = [_measured(swept, case, condition, option, index) for index, _ in INDEXES]
                rows.append((case, words(condition), option, *times))
    page = Page(
        title="Islanding over late and lossy links, with every option of the agents",
        panels=panels,
        columns=len(conditions),
        names={style: swept.base.cases[case].title for style, case in enumerate(CASES)},
        looks={"points": "measured", "hollow": "predicted (hold)"},
        share_y=True,
        height=2.6,
    )
    return ExperimentResult(
        page=page, table=ExperimentTable(columns=("graph", "links", "handling", "f (s)", "sharing (s)"), rows=rows)
    )


def words(condition: Condition) -> str:
    """Return a condition in words.

    Examples
    --------
    >>> words((0.1, 0.0)), words((0.0, 0.9)), words((0.0, 0.0))
    ('late by 0.1 s', 'loss 90 %', 'good links')
    """
    late, lost = condition
    return f"late by {late:g} s" if late else f"loss {100 * lost:g} %" if lost else "good links"


def _condition(row: RunColumns) -> Condition:
    entries = json.loads(row["link"])
    return (entries[0].get("delay", 0.0), entries[0].get("loss", 0.0)) if entries else (0.0, 0.0)


def _measured(swept: SweepData, case: str, condition: Condition, option: str, index: str) -> float:
    wanted = {f"handling.{key}": value for key, value in {**_PAPER, **OPTIONS[option]}.items()}
    (row,) = (row for row in swept.where({"case": case, **wanted}) if _condition(row) == condition)
    return swept.measure(row, index)


def _predicted(swept: SweepData, case: str, condition: Condition) -> tuple[float, float]:
    late, lost = condition
    return of_times(predicted_times(swept.fleet(case), link_delay_s=late, loss=lost, load=swept.load))
