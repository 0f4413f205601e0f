"""Links that are down for a while: groups that do not hear each other while the load falls, and a link that flaps."""

from __future__ import annotations

import numpy as np

from gridpeers.measures import Floats
from gridpeers.papers.singhal2022.experiments.experiment_data import CaseData, cut_between, times_of, without
from gridpeers.papers.singhal2022.experiments.experiment_output import (
    Curve,
    ExperimentResult,
    ExperimentTable,
    Look,
    Page,
    Panel,
    TableCell,
)
from gridpeers.theory import Case, Loop, Ticks, Times, predicted_times, sharing_index

COLUMNS = (
    ("halves", ("halves", "halves-expire")),
    ("microgrids", ("microgrids", "microgrids-expire")),
    ("one follower alone", ("alone",)),
)
"""Panels side by side: cases with the last state held, then with states that expire."""

HELD, EXPIRED, WHOLE = 0, 1, 6
"""Styles."""

LOST = 1.0 - 1e-12
"""Probability that a message is lost in a partition, for the model, which asks for less than 1."""


def partition(runs: CaseData) -> ExperimentResult:
    """Return f and MPSI over time, with their values at the end of the partition and the times to come back."""
    split = runs.scenario.cases["halves"].netem.partitions[0]
    event = runs.scenario.events[-1]
    start, end = split.from_s, split.to_s or runs.scenario.time.end_s
    panels = []
    for row, (title, measure) in enumerate((("f", runs.f), ("MPSI", runs.MPSI))):
        for name, cases in COLUMNS:
            curves = [Curve(runs.t("whole"), measure("whole"), WHOLE, "reference")]
            for style, case in zip((HELD, EXPIRED), cases, strict=False):
                curves.append(Curve(runs.t(case), measure(case), style, "solid"))
                t, theory = predicted(runs, case, end - event.t_s)
                curves.append(Curve(t + event.t_s, theory[row], style, "predicted"))
            panels.append(
                Panel(
                    title=f"{title}, {name}",
                    x_label="time (s)",
                    y_label=("f, mean of the GFM (Hz)", "MPSI")[row],
                    curves=curves,
                    spans=[(start, end)],
                    x_range=(2.0, runs.scenario.time.end_s),
                    y_range=((59.97, 60.25), (0.0, 0.25))[row],
                )
            )
    looks: dict[Look, str] = {"predicted": "predicted for the time in groups"}
    names = {
        WHOLE: "no partition",
        HELD: "in groups, last state held",
        EXPIRED: "in groups, states expire after 0.25 s",
    }
    page = Page(
        title="In groups from 2.5 to 7 s (grey); a third of the load is lost at 3 s",
        panels=panels,
        columns=3,
        names=names,
        looks=looks,
        height=2.5,
    )
    return ExperimentResult(page=page, table=_table(runs, start, event.t_s, end))


def predicted(runs: CaseData, case: str, length: float) -> tuple[Floats, tuple[Floats, Floats]]:
    """Return the time after the loss of load (s), and f (Hz) and MPSI, as long as the groups last.

    A held state stays, as if all later messages were lost; with expired states the link is left out.
    """
    inverters, load = runs.inverters(case), runs.loads[runs.scenario.events[-1].label]
    cut = cut_between(inverters, groups_of(runs, case))
    expires = runs.scenario.cases[case].degraded_communication.max_age > 0.0
    ticks = Ticks() if expires else Ticks(loss=dict.fromkeys(cut, LOST))
    loop = Loop(inverters=without(inverters, cut) if expires else inverters, ticks=ticks)
    nominal = load.load_pu * float(inverters.weight @ inverters.m_p)
    path = loop.run(round(length / inverters.T_c), load.start_pu * inverters.m_p, nominal, islanding=load.islanding)
    return path.t, (runs.feeder.f_nom * (1.0 + path.e), sharing_index(path, inverters))


def groups_of(runs: CaseData, case: str) -> dict[str, str]:
    """Return the group of each inverter in the case's partition."""
    (split,) = runs.scenario.cases[case].netem.partitions
    microgrids = {row.name: row.microgrid for row in runs.feeder.inverters}
    return {name: split.group(name, microgrids) or "" for name in microgrids}


def _table(runs: CaseData, start: float, event: float, end: float) -> ExperimentTable:
    rows: list[list[TableCell]] = []
    for case, rule in runs.scenario.cases.items():
        t, after = runs.t(case), runs.settling(case, end, runs.scenario.time.end_s)
        apart = round(1e3 * (runs.mean(runs.f(case), case, end) - runs.feeder.f_nom), 1) + 0.0  # no -0
        theory: tuple[float, float] | tuple[str, str] = ("", "")
        if rule.netem.partitions:
            _, (f, MPSI) = predicted(runs, case, end - event)
            theory = round(1e3 * (float(f[-1]) - runs.feeder.f_nom), 1), round(float(MPSI[-1]), 3)
        largest = 1e3 * float(np.abs(runs.f(case)[t > end] - runs.feeder.f_nom).max())
        shared = runs.mean(runs.MPSI(case), case, end)
        rows.append(
            [rule.title, theory[0], apart, theory[1], round(shared, 3), after.t_f_s, after.t_share_s, round(largest, 1)]
        )
    columns = (
        "case",
        "f - 60 before it ends, predicted (mHz)",
        "measured (mHz)",
        "MPSI before it ends, predicted",
        "measured",
        "f back after (s)",
        "sharing back after (s)",
        "largest abs(f - 60) after (mHz)",
    )
    return ExperimentTable(columns=columns, rows=rows)


def flapping(runs: CaseData) -> ExperimentResult:
    """Return f and MPSI over time, and times after each event."""
    cases = runs.scenario.cases
    panels = [
        Panel(
            title=title,
            x_label="time (s)",
            y_label=y_label,
            curves=[Curve(runs.t(case), measure(case), i, "trace") for i, case in enumerate(cases)],
            x_range=(0.5, runs.scenario.time.end_s),
            y_range=y_range,
        )
        for title, measure, y_label, y_range in (
            ("Frequency", runs.f, "f, mean of the GFM (Hz)", (59.88, 60.15)),
            ("Power sharing", runs.MPSI, "MPSI", (0.0, 0.25)),
        )
    ]
    page = Page(
        title="A flapping link; islanding at 1 s, loss of load at 6 s",
        panels=panels,
        columns=1,
        names={i: case.title for i, case in enumerate(cases.values())},
        height=2.4,
    )
    return ExperimentResult(page=page, table=_flapping_table(runs))


def extra_age(rule: Case) -> float:
    """Return the mean age (s) that flapping adds to held states: d^2 / (2 (u + d)); while down, ages rise to d."""
    flaps = [entry.flap for entry in rule.netem.links if entry.flap is not None]
    return sum(flap.down_s**2 / (2.0 * (flap.up_s + flap.down_s)) for flap in flaps)


def _flapping_table(runs: CaseData) -> ExperimentTable:
    ends = [event.t_s for event in runs.scenario.events[1:]] + [runs.scenario.time.end_s]
    rows: list[list[TableCell]] = []
    for case, rule in runs.scenario.cases.items():
        row: list[TableCell] = [rule.title, extra_age(rule)]
        for event, end in zip(runs.scenario.events, ends, strict=True):
            theory = times_of(_flapping_predicted(runs, case, event.label))
            found = runs.settling(case, event.t_s, end)
            row += [theory[0], found.t_f_s, theory[1], found.t_share_s]
        rows.append(row)
    columns = ["case", "mean age added (s)"]
    for event in runs.scenario.events:
        for what in ("f", "sharing"):
            columns += [f"{event.label}, {what}, predicted (s)", "measured (s)"]
    return ExperimentTable(columns=columns, rows=rows)


def _flapping_predicted(runs: CaseData, case: str, label: str) -> Times:
    """Return times with the flapping link as one that is always late by its mean age; one that is cut is not there."""
    rule, inverters = runs.scenario.cases[case], runs.inverters(case)
    ends = ("inv4", "inv5")
    late = {(a, b): inverters.T_c + extra_age(rule) for a in ends for b in ends if a != b}
    if any(entry.cut for entry in rule.netem.links):
        return predicted_times(without(inverters, set(late)), load=runs.loads[label])
    return predicted_times(inverters, link_delay_s=late, load=runs.loads[label])
