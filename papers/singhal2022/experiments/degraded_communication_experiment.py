"""Options of `[degraded_communication]` for late and lost states, measured under delay and loss."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES, SweepData
from gridpeers.papers.singhal2022.experiments.experiment_output import (
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
"""Options of the sweep by name; keys that they leave out are as in the paper."""

_PAPER = {"stale": "hold", "T_age_s": 0.2, "weights": "paper", "kappa_c": 12.0, "anti_windup": "clamp"}


def degraded_communication(sweep: SweepData) -> ExperimentResult:
    """Return the times of every option under every condition."""
    conditions = {links: _condition(links) for links in sweep.rows["link"].unique().tolist()}
    theory = {
        (case, links): sweep.predicted(case, link_delay_s=late, loss=lost)
        for case in CASES
        for links, (late, lost) in conditions.items()
    }

    def measured(case: str, links: str, option: str, index: str) -> float:
        options = {f"degraded_communication.{key}": value for key, value in (_PAPER | dict(OPTIONS[option])).items()}
        (value,) = sweep.measured(index, sweep.where({"case": case, "link": links, **options}))
        return float(value)

    panels: list[Panel] = []
    for number, (index, title) in enumerate(INDEXES):
        for links, condition in conditions.items():
            curves = []
            for style, case in enumerate(CASES):
                x = np.arange(float(len(OPTIONS))) + 0.18 * (style - 1)
                y = np.array([measured(case, links, option, index) for option in OPTIONS])
                predicted = np.array([theory[case, links][number]])
                curves += [Curve(x, y, style, "points"), Curve(x[:1], predicted, style, "hollow")]
            panels.append(
                Panel(
                    title=words(*condition),
                    x_label="",
                    y_label=f"{title.partition(',')[0]}, time (s)" if links == next(iter(conditions)) else "",
                    curves=curves,
                    log="y",
                    x_names=list(OPTIONS) if number else [""] * len(OPTIONS),
                    y_range=(0.2, 30.0),
                )
            )
    page = Page(
        title="Islanding over late and lossy links, with every option of the agents",
        panels=panels,
        columns=len(conditions),
        names=sweep.names(CASES),
        looks={"points": "measured", "hollow": "predicted (hold)"},
        share_y=True,
        height=2.6,
    )
    rows: list[tuple[TableCell, ...]] = []
    for case in CASES:
        for links, condition in conditions.items():
            rows.append((case, words(*condition), "hold, predicted", *theory[case, links]))
            rows += [
                (case, words(*condition), option, *(measured(case, links, option, index) for index, _ in INDEXES))
                for option in OPTIONS
            ]
    columns = ("graph", "links", "option", "f (s)", "sharing (s)")
    return ExperimentResult(page=page, table=ExperimentTable(columns=columns, rows=rows))


def words(late: float, lost: float) -> str:
    """Return a delay (s) and a loss of all agent-agent links in words.

    >>> words(0.1, 0.0), words(0.0, 0.9), words(0.0, 0.0)
    ('late by 0.1 s', 'loss 90 %', 'good links')
    """
    return f"late by {late:g} s" if late else f"loss {100 * lost:g} %" if lost else "good links"


def _condition(links: str) -> tuple[float, float]:
    entries = json.loads(links)
    return (entries[0].get("delay", 0.0), entries[0].get("loss", 0.0)) if entries else (0.0, 0.0)
