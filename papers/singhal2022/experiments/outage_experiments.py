"""Links that are down for a while: groups that do not hear each other while the load falls, and a link that flaps."""

from __future__ import annotations

from typing import Any

import numpy as np

from gridpeers import theory
from gridpeers.measures import Floats
from gridpeers.papers.singhal2022.experiments.experiment_data import INDEXES, CaseData, times_of, without
from gridpeers.papers.singhal2022.experiments.experiment_output import Curve, ExperimentResult, PlotPage, PlotPanel

COLUMNS = (
    ("halves", ("halves", "halves-expire")),
    ("microgrids", ("microgrids", "microgrids-expire")),
    ("one follower alone", ("alone",)),
)
"""Panels side by side: cases with the last state held, then with states that expire."""

HELD, EXPIRED, WHOLE = 0, 1, 6  # Styles

LOST = 1.0 - 1e-12  # Probability of losing a message in a partition, below 1 for the model


def partition(runs: CaseData) -> ExperimentResult:
    """Return f and MPSI over time, their values at the end of the partition, and the times to return."""
    split = runs.scenario.cases["halves"].netem.partitions[0]
    event, last, f_nom = runs.scenario.events[-1], runs.scenario.time.end_s, runs.feeder.f_nom
    start, end = split.from_s, split.to_s or last
    split_cases = [case for case, rule in runs.scenario.cases.items() if rule.netem.partitions]
    of_theory = {case: predicted(runs, case, end - event.t_s) for case in split_cases}
    panels = []
    for row, (title, measure, y_label, y_range) in enumerate(_measures(runs, "f", "MPSI", (59.97, 60.25))):
        for name, cases in COLUMNS:
            curves = [Curve(runs.t("whole"), measure("whole"), WHOLE, "reference")]
            for style, case in zip((HELD, EXPIRED), cases, strict=False):
                t, of = of_theory[case]
                curves.append(Curve(runs.t(case), measure(case), style, "solid"))
                curves.append(Curve(t + event.t_s, of[row], style, "predicted"))
            panel = PlotPanel(
                title=f"{title}, {name}",
                x_label="time (s)",
                y_label=y_label,
                curves=curves,
                spans=[(start, end)],
                x_range=(2.0, last),
                y_range=y_range,
            )
            panels.append(panel)
    held, expired = "in groups, last state held", "in groups, states expire after 0.25 s"
    page = PlotPage(
        title="In groups from 2.5 to 7 s (grey); a third of the load is lost at 3 s",
        panels=panels,
        columns=3,
        names={WHOLE: "no partition", HELD: held, EXPIRED: expired},
        looks={"predicted": "predicted for the time in groups"},
        height=2.5,
    )
    rows = []
    for case, rule in runs.scenario.cases.items():
        after = runs.settling(case, end, last)
        f_off, MPSI = 1e3 * (runs.f(case) - f_nom), runs.MPSI(case)
        f_apart: float | str = ""
        MPSI_apart: float | str = ""
        if case in of_theory:
            _, (of_f, of_MPSI) = of_theory[case]
            f_apart, MPSI_apart = round(1e3 * (float(of_f[-1]) - f_nom), 1), round(float(of_MPSI[-1]), 3)
        cells = {
            "case": rule.title,
            "f - 60 before it ends, predicted (mHz)": f_apart,
            "measured (mHz)": round(runs.mean(f_off, case, end), 1) + 0.0,  # no -0
            "MPSI before it ends, predicted": MPSI_apart,
            "measured": round(runs.mean(MPSI, case, end), 3),
            "f back after (s)": after.t_f_s,
            "sharing back after (s)": after.t_share_s,
            "largest abs(f - 60) after (mHz)": round(float(np.abs(f_off[runs.t(case) > end]).max()), 1),
        }
        rows.append(cells)
    return ExperimentResult(page, rows)


def _measures(runs: CaseData, f: str, MPSI: str, f_range: tuple[float, float]) -> tuple[Any, ...]:
    """Return title, measure of a case, label and range of the axis, for the two rows of a figure."""
    return (f, runs.f, "f, mean of the GFM (Hz)", f_range), (MPSI, runs.MPSI, "MPSI", (0.0, 0.25))


def predicted(runs: CaseData, case: str, length: float) -> tuple[Floats, tuple[Floats, Floats]]:
    """Return the time after the loss of load (s), and f (Hz) and MPSI, as long as the groups last.

    A held state stays, as if all later messages were lost; with expired states the link is left out.
    """
    inverters, load = runs.inverters(case), runs.loads[runs.scenario.events[-1].label]
    (split,) = runs.scenario.cases[case].netem.partitions
    microgrids = {row.name: row.microgrid for row in runs.feeder.inverters}
    group = {name: split.group(name, microgrids) or "" for name in microgrids}
    names = [name for name in inverters.names if name in group]
    cut = {(a, b) for a in names for b in names if group[a] != group[b]}
    expires = runs.scenario.cases[case].degraded_communication.max_age > 0.0
    ticks = theory.Ticks() if expires else theory.Ticks(loss=dict.fromkeys(cut, LOST))
    loop = theory.Loop(inverters=without(inverters, cut) if expires else inverters, ticks=ticks)
    nominal = load.load_pu * float(inverters.weight @ inverters.m_p)
    path = loop.run(round(length / inverters.T_c), load.start_pu * inverters.m_p, nominal, islanding=load.islanding)
    return path.t, (runs.feeder.f_nom * (1.0 + path.e), theory.sharing_index(path, inverters))


def flapping(runs: CaseData) -> ExperimentResult:
    """Return f and MPSI over time, and times after each event."""
    cases, events = runs.scenario.cases, runs.scenario.events
    panels = [
        PlotPanel(
            title=title,
            x_label="time (s)",
            y_label=y_label,
            curves=[Curve(runs.t(case), measure(case), i, "trace") for i, case in enumerate(cases)],
            x_range=(0.5, runs.scenario.time.end_s),
            y_range=y_range,
        )
        for title, measure, y_label, y_range in _measures(runs, "Frequency", "Power sharing", (59.88, 60.15))
    ]
    page = PlotPage(
        title="A flapping link; islanding at 1 s, loss of load at 6 s",
        panels=panels,
        columns=1,
        names={i: case.title for i, case in enumerate(cases.values())},
        height=2.4,
    )
    ends = [*(event.t_s for event in events[1:]), runs.scenario.time.end_s]
    rows = []
    for case, rule in cases.items():
        rows.append(row := {"case": rule.title, "mean age added (s)": extra_age(rule)})
        for event, end in zip(events, ends, strict=True):
            times = _flapping_predicted(runs, case, event.label)
            found = runs.settling(case, event.t_s, end)
            for index, (what, _) in INDEXES.items():
                row[f"{event.label}, {what}, predicted (s)"] = times[index]
                row[f"{event.label}, {what}, measured (s)"] = getattr(found, index)
    return ExperimentResult(page, rows)


def extra_age(rule: theory.Case) -> float:
    """Return the mean age (s) that flapping adds to held states: d^2 / (2 (u + d)); while down, ages rise to d."""
    flaps = [entry.flap for entry in rule.netem.links if entry.flap is not None]
    return sum(flap.down_s**2 / (2.0 * (flap.up_s + flap.down_s)) for flap in flaps)


def _flapping_predicted(runs: CaseData, case: str, label: str) -> dict[str, float]:
    """Return times with the flapping link late by its mean age, or without the link if it is cut."""
    rule, inverters = runs.scenario.cases[case], runs.inverters(case)
    late = dict.fromkeys((("inv4", "inv5"), ("inv5", "inv4")), inverters.T_c + extra_age(rule))
    if any(entry.cut for entry in rule.netem.links):
        return times_of(theory.predicted_times(without(inverters, late), load=runs.loads[label]))
    return times_of(theory.predicted_times(inverters, link_delay_s=late, load=runs.loads[label]))
